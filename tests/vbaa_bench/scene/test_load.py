import ast
import json
import re
from pathlib import Path
from typing import Any

import pytest

from solver.instrument.errors import InputError
from tests.conftest import SCENE_TEXT
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.cli.data import say_what_is_drawn_once
from vbaa_bench.scene.load import SceneFile, check_scene, load_scene, recorded_scene
from vbaa_bench.scene.mistakes import RENAMED
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scene.shipped import shipped_scene_files

SCENES = Path(__file__).parents[3] / "scenes"


def complaints(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        plan(load_scene(path))
    return str(caught.value).replace(str(tmp_path) + "/", "").splitlines()


def test_fig8_is_the_papers_experiment() -> None:
    path = SCENES / "fig8_rigid.yaml"
    work = plan(load_scene(path))
    assert work.frames == 270
    for push in {trial.push for trial in work.frame_specs}:
        experiment = Experiment(load_scene(path).scene, work.rig, push, path.parent)
        for target, state in zip(push.targets, experiment.states(), strict=True):
            assert 0.03 < state.pushing_angle < 0.2  # about 2 to 11 degrees
            assert state.tip[1] / work.rig.beam.length == pytest.approx(
                target.deflection, rel=1e-12
            )


@pytest.fixture(scope="module", params=shipped_scene_files(), ids=lambda path: path.stem)
def shipped(request: pytest.FixtureRequest) -> SceneFile:
    """Each scene of this repository. Hundreds of draws of a random one are checked: up to 1 s."""
    return load_scene(request.param)


@pytest.mark.thorough
def test_a_recorded_scene_is_the_same_scene(shipped: SceneFile) -> None:
    record = json.loads(json.dumps(shipped.scene.model_dump(mode="json")))
    assert recorded_scene(record, shipped.path, shipped.folder).scene == shipped.scene


def test_every_key_has_a_description() -> None:
    schema = Scene.model_json_schema()
    sections = {**schema["$defs"], "Scene": schema}
    without = [
        f"{name}.{key}"
        for name, section in sections.items()
        for key, value in section.get("properties", {}).items()
        if key != "kind" and not value.get("description", "").endswith(".")
    ]
    assert len(sections) > 50
    assert without == []


def test_no_shipped_scene_fixes_the_motor_angle_of_first_contact(shipped: SceneFile) -> None:
    pushes = shipped.scene.pushes or shipped.scene.sampling
    assert pushes is not None
    low, high = pushes.motor_angle_at_contact_deg
    assert high - low >= 5


def test_every_mistake_is_listed_at_its_place(tmp_path: Path) -> None:
    text = """title: ''
seed: -1
beam:
  lenght_mm: 240
  diameter_mm: 0
camera: {roll_deg: abc, look_at_mm: [1, 2, 3, 4]}
sensor:
  bits: 9
pushes:
  contact_distance_mm: [60, -1]
  deflection_pct: [10]
layers: [dept]
extra: 1
"""
    found = complaints(tmp_path, text)
    assert found == [
        "scene.yaml:1:1: title is '', allowed is a text of at least 1 character",
        "scene.yaml:2:1: seed is -1, allowed is greater than or equal to 0",
        "scene.yaml:10:29: pushes.contact_distance_mm[1] is -1, "
        "allowed is greater than or equal to 0.000001",
        "scene.yaml:5:3: beam.diameter_mm is 0, allowed is greater than or equal to 0.000001",
        "scene.yaml:4:3: beam.lenght_mm is an unknown key; did you mean length_mm?",
        "scene.yaml:6:25: camera.look_at_mm is [1, 2, 3, 4], allowed is a list of at most 3",
        "scene.yaml:6:10: camera.roll_deg is 'abc', allowed is a number",
        "scene.yaml:8:3: sensor.bits is 9, allowed is one of 8, 10, 12, 14, 16",
        "scene.yaml:12:10: layers[0] is 'dept', allowed is one of radiance, variance, beam_mask, "
        "coverage, arc_length, depth, normal, object_index, occlusion",
        "scene.yaml:13:1: extra is an unknown key; known are title, seed, rigs, random_method, "
        "look, pushes, sampling, splits, mechanics, beam, gravity_m_s2, clamp_offset_mm, "
        "tolerances, camera, optics, motor_speed_deg_s, calibration, light, lights, light_level, "
        "flicker, "
        "ambient, background, clutter, wires, object, second_peg, occlusion, hub, clamp, "
        "carriage, sensor, "
        "moment_sensor, force_sensor, render, layers, frames_per_shard",
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[100, 200]", "[100, 240]", "contact_distance_mm[1] is 240, allowed is before"),
        ("[100, 200]", "[100, 239.9]", "is 239.9, pushed to 10 %, 20 %: the beam slips off"),
        ("[100, 200]", "[2.5, 100]", "is 2.5, allowed is beyond the hub's radius of 3 mm"),
        ("square_mm: 10", "square_mm: 20", "does not see the whole board in view 0"),
        ("height_px: 176", "height_px: 60", "does not see the whole beam"),
        ("[10, 20]", "[10, 59]", "MPa; push less, or set allow_above_yield: true"),
        ("rows: 5", "rows: 6", "one must be even and one odd"),
        ("deflection_pct: [10, 20]", "repeats: 2", "exactly one of deflection_pct and"),
        ("deflection_pct: [10, 20]", "deflection_pct: []", "is empty"),
        ("title: Four pushes for the tests\n", "", "title is missing"),
        ("seed: 11", "seed: 11\nseed: 12", "is not YAML"),
        ("pushes:", "pushes: [", "is not YAML"),
        ("seed: 11", "seed: .nan", "seed is nan"),
        ("seed: 11", "seed: yes", "seed is 'yes'"),  # YAML 1.2: yes is a text
        ("seed: 11", "seed: 11\n1: 2", "Keys should be strings"),
        ("[100, 200]", "[100, 250.2]", "contact_distance_mm[1] is 250.2, allowed is before"),
        ("look_at_mm: [120.6, 22.0, 0.0]", "look_at_mm: [0, 22.0, 360.0]", "beam's own direction"),
        ("look_at_mm: [120.6, 22.0, 0.0]", "look_at_mm: [120, 22, 720]", "away from the beam"),
        ("position_mm: [120.0, 22.0, 360.0]", "position_mm: [120, 22, 500]", "0 < camera < light"),
        (
            "position_mm: [120.0, 22.0, 360.0]",
            "position_mm: [120, 22]",
            "camera.position_mm[2] is missing",
        ),
        ("width_px: 512", "width_px: 512\n  focal_length_px: 60", "px wide, allowed is >= 0.25"),
        (
            "seed: 11",
            "seed: 11\nbeam: {youngs_modulus_gpa: 1e300}",
            "allowed is less than or equal to 1000000",
        ),
        (
            "seed: 11",
            "seed: 11\nobject: {kind: ball}",
            "4:10: object.kind is 'ball', allowed is one of block, cylinder, peg, sphere, ",
        ),
        ("seed: 11", "seed: 11\nobject: {side_mm: 5}", "object.kind is missing, allowed is one of"),
        (
            "seed: 11",
            "seed: 11\nobject: {kind: sphere, radius: 5}",
            "object.radius is an unknown key; did you mean radius_mm?",
        ),
        (
            "seed: 11",
            "seed: 11\nobject: {kind: sphere, radius_mm: -5}",
            "object.radius_mm is -5, allowed is greater than or equal to 0.000001",
        ),
        (
            "[10, 20]",
            "[10, 20]\n  stiffness_n_m: [soft]",
            "pushes.stiffness_n_m[0] is 'soft', allowed is a number or one of rigid",
        ),
        ("seed: 11", "seed: 11\nobject: {kind: wall, gap_mm: 5}", "except for a wall, which has"),
        ("seed: 11", "seed: 11\nobject: {kind: none}", "there is no contact: pushing_angle_deg"),
        ("seed: 11", "seed: 11\nmechanics: linear\nobject: {kind: peg}", "without a model of"),
        ("seed: 11", "seed: 11\nbeam: {section: strip}", "section strip with aspect_ratio 1"),
        ("seed: 11", "seed: 11\nsampling: {count: 5}", "sampling.contact_distance_mm is missing"),
        ("seed: 11", "seed: 11\nocclusion: {kind: [bars, leaves]}", "removed and one of sheet"),
        (
            "seed: 11",
            "seed: 11\nobject: {kind: mesh, file: none.stl}",
            "none.stl: cannot be read",
        ),
        (
            "seed: 11",
            "seed: 11\nobject: {kind: sphere, radius_mm: 10}",
            "the beam would slip off the sphere sideways",
        ),
        (
            "[10, 20]",
            "[10, 20]\n  normal_deg: [-70]",
            "the beam slides off the end of the object",
        ),
        ("width_px: 512", "width_px: 512\n  projection: telecentric", "magnification_px_per_mm"),
    ],
)
def test_impossible_scenes_are_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = SCENE_TEXT
    if "push less" in said:  # the whole beam in view, and a contact near the clamp
        text = text.replace("[100, 200]", "[20, 100]").replace("height_px: 176", "height_px: 500")
    found = complaints(tmp_path, text.replace(old, new))
    assert any(said in line for line in found), found
    assert all(line.startswith("scene.yaml:") for line in found)


def test_above_yield_is_allowed_when_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    text = SCENE_TEXT.replace("[100, 200]", "[20]").replace("[10, 20]", "[40]")
    text = text.replace("height_px: 176", "height_px: 400")
    path.write_text(text + "beam: {allow_above_yield: true}\n", encoding="utf-8")
    assert plan(load_scene(path)).frames == 1


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is neither a file nor a shipped scene"):
        load_scene(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        load_scene(tmp_path)
    path = tmp_path / "scene.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        load_scene(path)
    path.write_text("- a list\n", encoding="utf-8")
    with pytest.raises(InputError, match="allowed is a mapping"):
        load_scene(path)


@pytest.mark.parametrize(
    "lamp",
    [
        "{kind: area, position_mm: [120, 20, 200]}",
        # Below the camera, it hides the tip alone.
        "{kind: area, position_mm: [180, 20, 200], size_mm: [60, 60]}",
        "{kind: side, azimuth_deg: 0, elevation_deg: 89, distance_mm: 200}",
    ],
)
def test_a_lamp_before_the_camera_is_refused(tmp_path: Path, lamp: str) -> None:
    extra = f"lights:\n  - {{kind: ring}}\n  - {lamp}\n"
    assert complaints(tmp_path, SCENE_TEXT + extra) == [
        f"scene.yaml:{SCENE_TEXT.count(chr(10)) + 3}:5: lights[1] is between the camera and "
        "the beam or the board, allowed is out of its view"
    ]


def test_a_telecentric_camera_looks_along_parallel_lines(tmp_path: Path) -> None:
    camera = "projection: telecentric\n  magnification_px_per_mm: 1.9\n  height_px: 176"
    text = SCENE_TEXT.replace("height_px: 176", camera)
    lamp = "lights: [{kind: area, position_mm: [X, 20, 200], size_mm: [60, 60]}]\n"
    (message,) = complaints(tmp_path, text + lamp.replace("X", "230"))
    assert "lights[0] is between" in message
    path = tmp_path / "beside.yaml"
    path.write_text(text + lamp.replace("X", "290"), encoding="utf-8")
    assert plan(load_scene(path)).frames == 4


def test_only_one_light_may_be_all_around(tmp_path: Path) -> None:
    (message,) = complaints(
        tmp_path, SCENE_TEXT + "lights: [{kind: environment}, {kind: environment}]\n"
    )
    assert "environment and environment are all around, allowed is one" in message


def test_the_motor_angles_of_first_contact_are_a_range(tmp_path: Path) -> None:
    for ends, said in [
        ("[5, -5]", "motor_angle_at_contact_deg is [5.0, -5.0], allowed is a range from low"),
        ("7", "motor_angle_at_contact_deg is 7"),
    ]:
        (message,) = complaints(tmp_path, SCENE_TEXT.replace(
            "pushes:\n", f"pushes:\n  motor_angle_at_contact_deg: {ends}\n"
        ))  # fmt: skip
        assert said in message


@pytest.mark.parametrize(
    ("section", "old"), [(section, old) for section in RENAMED for old in RENAMED[section]]
)
def test_a_renamed_key_is_named(section: str, old: str) -> None:
    given: dict[str, Any] = {old: 1}
    if section == "lights":
        kinds = {"inner": "ring", "outer": "ring", "lift": "back", "edge": "stripe", "cone": "spot"}
        kind = kinds.get(old.partition("_")[0], "environment")
        given = {"lights": [{"kind": kind} | given]}
    elif section:
        given = {section: given}
    new = RENAMED[section][old]
    with pytest.raises(InputError) as error:
        check_scene({"title": "Old keys", "seed": 1} | given)
    assert f"{old} is an unknown key; it is now called {new}" in str(error.value)
    renamed = str(given).replace(f"'{old}'", f"'{new}'")
    with pytest.raises(InputError) as error:
        check_scene({"title": "New keys", "seed": 1} | ast.literal_eval(renamed))
    assert "unknown key" not in str(error.value)


def test_draws_is_another_name_of_repeats(tmp_path: Path) -> None:
    pushes = {"contact_distance_mm": [100], "deflection_pct": [5]}
    old, new = (
        check_scene({"title": "T", "seed": 1, "pushes": {**pushes, name: 4}})
        for name in ("repeats", "draws")
    )
    # The record of a dataset has the name of before.
    assert new.scene == old.scene
    assert new.scene.model_dump(mode="json")["pushes"]["repeats"] == 4
    assert load_scene("train_2d", settings=["pushes.draws=7"]).scene.pushes.repeats == 7  # type: ignore[union-attr]
    assert load_scene("train_2d", settings=["pushes.repeats=8"]).scene.pushes.repeats == 8  # type: ignore[union-attr]
    text = SCENE_TEXT.replace("pushes:\n", "pushes:\n  draws: 2\n")
    line = text[: text.index("draws")].count("\n") + 1
    said = complaints(tmp_path, text.replace("draws: 2", "draws: 0"))
    assert said == [
        f"scene.yaml:{line}:3: pushes.repeats is 0, allowed is greater than or equal to 1"
    ]
    (both,) = complaints(tmp_path, text.replace("draws: 2", "draws: 2\n  repeats: 2"))
    assert both.endswith("pushes.draws is another name of repeats, allowed is one of the two")
    (unknown,) = complaints(tmp_path, text.replace("draws: 2", "draw: 2"))
    assert unknown.endswith("did you mean draws?")


@pytest.mark.parametrize(
    ("setting", "allowed"),
    [
        ("camera=3", "a section of keys"),
        ("object=3", "a section of keys"),
        ("lights=3", "a list"),
        ("beam.extensible=maybe", "true or false"),
        ("title=3", "a text, in quotes if it looks like a number"),
    ],
)
def test_what_is_allowed_is_said_in_the_words_of_yaml(setting: str, allowed: str) -> None:
    with pytest.raises(InputError, match=f"allowed is {allowed}$"):
        load_scene("quickstart", settings=[setting])


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("camera.width_px=3", "camera.width_px is 3, allowed is greater than or equal to 32"),
        ("camera.widt_px=300", "camera.widt_px is an unknown key; did you mean width_px?"),
        ("lights.0.kind=rign", "lights[0].kind is 'rign', allowed is one of"),
        ("beam.length_mm={unifrm: [3, 5]}", "beam.length_mm is {'unifrm': (3, 5)}"),
    ],
)
def test_a_mistake_in_a_setting_is_not_that_of_the_file(setting: str, sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(f"ring.yaml with {setting}: {sentence}")):
        load_scene("lighting/ring", settings=["seed=5", setting])


def test_keys_that_are_drawn_once_for_all_frames_are_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    diameter = "beam.diameter_mm={uniform: [0.6, 0.8]}"
    friction = "object={kind: block, friction: {uniform: [0, 0.3], per: push}}"
    file = load_scene("quickstart", settings=[diameter, friction])
    assert file.drawn_once == ("beam.diameter_mm",)
    say_what_is_drawn_once(file)
    assert "drawn once for all frames: beam.diameter_mm; with per:" in capsys.readouterr().err
    assert load_scene("quickstart").drawn_once == ()
    # Of a collection, such a key is drawn for every rig.
    assert load_scene("quickstart", settings=[diameter, "rigs=3"]).drawn_once == ()
