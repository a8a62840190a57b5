"""The JSON Schema allows what the loader allows, and finds what an editor can find."""

from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML

from vbaa_bench.scene.json_schema import file_schema
from vbaa_bench.scene.shipped import shipped_scene_files

SCENES = shipped_scene_files()
SCHEMA = file_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
SCENE: dict[str, Any] = {
    "title": "One push",
    "seed": 1,
    "pushes": {"contact_distance_mm": [120], "deflection_pct": [5]},
}


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


def test_every_shipped_scene_is_allowed() -> None:
    reader = YAML(typ="safe")
    assert len(SCENES) > 60
    for path in SCENES:
        VALIDATOR.validate(reader.load(path))


@pytest.mark.parametrize(
    "more",
    [
        {"beam": {"length_mm": {"uniform": [100, 200], "per": "push"}}},
        {"beam": {"choice": [{"diameter_mm": 1.0}, {"diameter_mm": 2.0}]}},
        {"camera": {"position_mm": {"normal": [[120, 18, 360], 5], "clip": [0, 400]}}},
        {"pushes": SCENE["pushes"] | {"contact_distance_mm": [{"from": "beam.length_mm"}]}},
    ],
)
def test_a_distribution_may_stand_in_place_of_a_value(more: dict[str, Any]) -> None:
    VALIDATOR.validate(SCENE | more)


@pytest.mark.parametrize(
    "more",
    [
        {"beam": {"lenght_mm": 240}},
        {"beam": {"length_mm": -1}},
        {"beam": {"paint": "red"}},
        {"beam": {"length_mm": {"uniforms": [100, 200]}}},
        {"object": {"kind": "ball"}},
        {"seed": {"uniform": [1, 2]}},
        {"random_keys": []},
    ],
)
def test_a_mistake_is_found(more: dict[str, Any]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        VALIDATOR.validate(SCENE | more)
