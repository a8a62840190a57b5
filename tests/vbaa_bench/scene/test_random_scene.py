"""Random keys of a scene: drawn at their levels, checked when loaded, independent of each other."""

from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

from solver.instrument.errors import InputError
from vbaa_bench.scene.frames import frame_specs
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.random_scene import RejectedDrawError

PUSHES = "pushes: {contact_distance_mm: [100], deflection_pct: [5, 10], repeats: 6}\n"


def scene(folder: Path, text: str, pushes: str = PUSHES) -> SceneFile:
    path = folder / "random.yaml"
    seed = "" if text.startswith("seed") else "seed: 7\n"
    path.write_text(f"title: Random\n{seed}{pushes}{dedent(text)}", encoding="utf-8")
    return load_scene(path)


def test_a_key_is_drawn_per_rig_push_or_frame(tmp_path: Path) -> None:
    file = scene(
        tmp_path,
        """\
        beam: {diameter_mm: {log_uniform: [0.5, 1.2]}}
        object: {kind: peg, radius_mm: {uniform: [1, 3], per: push}}
        background: {reflectance: {uniform: [0.02, 0.2], per: frame}}
        """,
    )
    specs = sorted(frame_specs(file.scene), key=lambda spec: spec.index)
    assert len(specs) == 12
    assert {spec.scene.beam.diameter_mm for spec in specs} == {file.scene.beam.diameter_mm}
    assert len({spec.scene.object.radius_mm for spec in specs}) == 6  # type: ignore[attr-defined]
    for one, other in zip(specs[::2], specs[1::2], strict=True):
        assert one.push_id == other.push_id
        assert one.scene.object == other.scene.object
    assert len({spec.scene.background.reflectance for spec in specs}) == 12


def test_a_key_is_computed_from_another(tmp_path: Path) -> None:
    file = scene(
        tmp_path,
        """\
        beam: {length_mm: {uniform: [200, 260]}}
        camera:
          position_mm: [{from: beam.length_mm, times: 0.5}, 18, {from: light.height_mm, plus: -40}]
        tolerances: {beam_length_mm: {from: beam.length_mm, times: {uniform: [1e-4, 1e-3]}}}
        """,
    )
    drawn = [file.rig(number).scene for number in range(5)]
    for one in drawn:
        assert one.camera.position_mm == (one.beam.length_mm / 2, 18.0, one.light.height_mm - 40)
        assert 1e-4 <= one.tolerances.beam_length_mm / one.beam.length_mm <= 1e-3
    assert len({one.beam.length_mm for one in drawn}) == 5


def test_a_whole_section_is_chosen_with_its_own_random_keys(tmp_path: Path) -> None:
    file = scene(
        tmp_path,
        """\
        object:
          choice:
          - {kind: peg, radius_mm: {uniform: [1, 3]}}
          - {kind: block, side_mm: {uniform: [8, 20]}, paint: {choice: [matt, gloss], per: frame}}
          weights: [1, 2]
          per: push
        """,
        PUSHES.replace("repeats: 6", "repeats: 60"),
    )
    specs = sorted(frame_specs(file.scene), key=lambda spec: spec.index)
    objects: list[Any] = [spec.scene.object for spec in specs]
    blocks = [one for one in objects if one.kind == "block"]
    assert 50 < len(blocks) < 110  # of 120 frames, two in three
    assert {one.paint for one in blocks} == {"matt", "gloss"}
    assert {one.paint for one in objects if one.kind == "peg"} == {"matt"}
    assert any(
        first.paint != second.paint
        for first, second in zip(objects[::2], objects[1::2], strict=True)
    )


def test_another_random_key_moves_no_other(tmp_path: Path) -> None:
    one = scene(tmp_path, "beam: {diameter_mm: {uniform: [0.5, 1.2]}}\nrandom_method: sobol\n")
    both = scene(
        tmp_path,
        "beam: {diameter_mm: {uniform: [0.5, 1.2]}, reflectance: {uniform: [0.5, 0.9]}}\n"
        "random_method: sobol\n",
    )
    for number in range(4):
        assert one.rig(number).scene.beam.diameter_mm == both.rig(number).scene.beam.diameter_mm


def test_a_rig_depends_neither_on_the_number_of_rigs_nor_on_that_of_pushes(tmp_path: Path) -> None:
    text = "rigs: {}\nbeam: {{length_mm: {{uniform: [200, 260]}}}}\n"
    few = scene(tmp_path, text.format(3))
    many = scene(tmp_path, text.format(300), PUSHES.replace("repeats: 6", "repeats: 9"))
    for number in range(3):
        one, other = few.rig(number).scene, many.rig(number).scene
        assert one.seed == other.seed
        assert one.beam == other.beam
        ids = {spec.index: spec.frame_id for spec in frame_specs(one)}
        assert ids.items() <= {spec.index: spec.frame_id for spec in frame_specs(other)}.items()
    assert len({many.rig(number).scene.seed for number in range(300)}) == 300


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("beam: {length_mm: {uniform: [-5, 260]}}", r":4:8: beam.length_mm is -5.0, allowed is"),
        ("camera: {width_px: {uniform: [300, 400]}}", "camera.width_px is 300.0, allowed is a"),
        ("beam: {paint: {choice: [gloss, pink]}}", "beam.paint is 'pink', allowed is one of"),
        ("beam: {length_mm: {uniform: [260, 200]}}", "from low to high"),
        ("beam: {length_mm: {uniform: [200, 260], around: 3}}", "unknown key of the distribution"),
        ("beam: {length_mm: {uniform: [200, 260], per: frame}}", "per frame, allowed is per: rig"),
        ("object: {kind: peg, radius_mm: {uniform: [1, 2], per: frame}}", "per: rig or push"),
        ("beam: {length_mm: {from: beam.len_mm}}", "from beam.len_mm, which does not exist"),
        (
            "beam: {length_mm: {from: light.side_mm}}\nlight: {side_mm: {from: beam.length_mm}}",
            "which is computed from it",
        ),
        (
            "light: {side_mm: {uniform: [500, 700], per: frame}, height_mm: {from: light.side_mm}}",
            "add per: frame",
        ),
        (
            "beam: {length_mm: {from: light.side_mm, times: {uniform: [[1, 2], 3]}}}",
            "times is a random vector, allowed is a number",
        ),
        ("beam: {lenght_mm: {uniform: [1, 2]}}", "unknown key; did you mean length_mm"),
        ("beam: {length_mm: -3, diameter_mm: {uniform: [1, 2]}}", "beam.length_mm is -3, allowed"),
        ("camera: {position_mm: [120, 18, {uniform: [300, 900]}]}", "draws of the random keys are"),
        ("pushes: {normal_deg: {choice: [[0], [1]], per: push}}", "a list of fixed length"),
        ("seed: {integers: [1, 2]}", "seed cannot be random"),
        ("rigs: -3", "rigs is -3, allowed is"),
        ("rigs: {choice: [1, 2]}", "rigs cannot be random"),
        ("random_keys: []", "distributions are stated in the places of values"),
        ("seed: [1]\nbeam: {length_mm: {uniform: [200, 260]}}", "seed is"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, message: str) -> None:
    pushes = "" if text.startswith("pushes") else PUSHES
    with pytest.raises(InputError, match=message):
        scene(tmp_path, text + "\n", pushes)


@pytest.mark.thorough
def test_a_rejected_draw_is_drawn_again(tmp_path: Path) -> None:
    """A third of the lamps would be below the camera: these rigs get other lamps."""
    file = scene(tmp_path, "light: {height_mm: {uniform: [300, 480]}}\n")
    heights = [file.scene.light.height_mm]
    for number in range(100):
        frames = [attempt for attempt in range(64) if _height(file, number, attempt) is not None]
        heights.append(_height(file, number, frames[0]) or 0.0)
        assert frames[1:] != []
    assert min(heights) > 360


def _height(file: SceneFile, number: int, attempt: int) -> float | None:
    try:
        return file.rig(number, attempt).scene.light.height_mm
    except RejectedDrawError:
        return None
