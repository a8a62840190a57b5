"""Manifests of unknown origin are refused with the key that is wrong."""

import copy
import json
import math
from pathlib import Path
from typing import Any

import pytest

from solver.instrument.errors import InputError
from vbaa_bench.dataset.manifest import checked_manifest
from vbaa_bench.scene.load import load_scene

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.fixture(scope="module")
def manifest(dataset: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((dataset / "truth" / "manifest.json").read_bytes())
    return document


def test_a_generated_manifest_is_unchanged(manifest: dict[str, Any]) -> None:
    assert checked_manifest(Path("m"), manifest) == manifest


def test_keys_of_a_newer_version_get_their_defaults(manifest: dict[str, Any]) -> None:
    older = copy.deepcopy(manifest)
    del older["scene"]["gravity_m_s2"], older["scene"]["beam"]["bow_mm"]
    older["scene"]["of_another_version"] = 1
    scene = checked_manifest(Path("m"), older)["scene"]
    assert scene["gravity_m_s2"] == manifest["scene"]["gravity_m_s2"]
    assert scene["beam"] == manifest["scene"]["beam"]


def test_a_kind_of_a_module_that_is_not_in_use_can_be_read(manifest: dict[str, Any]) -> None:
    document = copy.deepcopy(manifest)
    document["scene"]["lights"] = [{"kind": "glow", "slide": "a.png"}]
    assert checked_manifest(Path("m"), document) == document
    document["scene"]["lights"][0]["kind"] = "glow\n" * 1000
    with pytest.raises(InputError, match=r"m: scene\.lights\.0 is "):
        checked_manifest(Path("m"), document)


@pytest.mark.parametrize("name", ["float_tiny", "float_huge"])
def test_the_largest_and_the_smallest_scene_are_accepted(
    manifest: dict[str, Any], name: str
) -> None:
    beam = load_scene(SCENES / "hard" / f"{name}.yaml").scene.beam
    document = copy.deepcopy(manifest)
    document["true_rig"]["beam_length_mm"] = beam.length_mm
    document["true_rig"]["beam_diameter_mm"] = beam.diameter_mm
    document["true_rig"]["flexural_rigidity_n_mm2"] = (
        beam.youngs_modulus_gpa * 1e3 * math.pi * beam.diameter_mm**4 / 64
    )
    assert checked_manifest(Path("m"), document) == document


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("true_rig", None, "true_rig is None, allowed is a section"),
        ("true_rig.beam_length_mm", "x", "true_rig.beam_length_mm is 'x', allowed is a number"),
        ("true_rig.beam_length_mm", 0, "true_rig.beam_length_mm is 0, allowed is"),
        ("true_rig.base_position_mm", [1, 2], "a list of three numbers"),
        ("true_rig.camera.width_px", 0.5, "a whole number"),
        ("true_rig.camera.telecentric", "no", "allowed is true or false"),
        ("true_rig.camera.distortion", [0.1], "a list of 0, 5 or 8 numbers"),
        ("true_rig.camera.camera_from_antenna", [[1.0]], "four rows of four numbers"),
        ("seed", "x", "seed is 'x'"),
        ("variant", 3, "variant is 3, allowed is a text"),
        ("scene", [], r"scene is \[\], allowed are keys and values"),
        ("scene.camera", 3, "scene.camera is 3"),
        ("scene.lights", [3], "scene.lights.0"),
        ("scene.random_keys", [3], "random_keys are not those of a generated scene"),
    ],
)
def test_wrong_values_are_named(
    manifest: dict[str, Any], key: str, value: object, said: str
) -> None:
    document = copy.deepcopy(manifest)
    *sections, last = key.split(".")
    node = document
    for section in sections:
        node = node[section]
    node[last] = value
    with pytest.raises(InputError, match=said):
        checked_manifest(Path("m"), document)
