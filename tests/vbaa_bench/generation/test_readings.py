"""What the sensors read in a frame, and what a solver is told of it."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.experiment import LINEAR, PLANAR, SPATIAL, Experiment
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.generation.readings import readings
from vbaa_bench.generation.truth_row import truth_row
from vbaa_bench.scene.frames import FrameSpec, frame_specs
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.rigs import true_rig


def scene_of(tmp_path: Path, extra: str, pushes: str = "") -> SceneFile:
    path = tmp_path / "scene.yaml"
    text = SMALL_SCENE.replace("  deflection_pct: [10, 20]\n", pushes or "  deflection_pct: [10]\n")
    path.write_text(text + extra, encoding="utf-8")
    return load_scene(path)


def experiment_of(file: SceneFile, spec: FrameSpec) -> Experiment:
    return Experiment(file.scene, true_rig(file.scene), spec.push, file.path.parent)


def test_the_steps_of_a_push_share_its_name(tmp_path: Path) -> None:
    made = frame_specs(
        scene_of(tmp_path, "", "  pushing_angle_deg: [2, 4, 6]\n  repeats: 2\n").scene
    )
    assert len(made) == 2 * 2 * 3
    assert len({spec.push_id for spec in made}) == 4
    for name in {spec.push_id for spec in made}:
        steps = [spec for spec in made if spec.push_id == name]
        assert sorted(spec.step for spec in steps) == [0, 1, 2]
        assert len({spec.push for spec in steps}) == 1


def test_moment_and_force_sensors_read_what_the_clamp_bears(tmp_path: Path) -> None:
    extra = (
        "object: {kind: knife_edge}\nmoment_sensor: {sigma_n_mm: 0.01}\n"
        "force_sensor: {force_sigma_n: 1.0e-4, moment_sigma_n_mm: 0.01}\n"
    )
    file = scene_of(tmp_path, extra, "  deflection_pct: [10]\n  normal_deg: [30]\n  repeats: 30\n")
    moments, forces = [], []
    for spec in frame_specs(file.scene):
        state = experiment_of(file, spec).states()[0]
        values = readings(file.scene, spec, state, None)
        contact = state.contact
        # (27) with a right-handed m_y; the exact base moment is r x F.
        m_y = np.cross(contact.point, contact.force)[1]
        assert (np.sign(m_y), np.sign(contact.force[2])) == (-1, 1)
        moments.append(float(values["moment_y_n_mm"]) - 1e3 * m_y)
        forces.append([float(values[f"base_force_{a}_n"]) for a in "xyz"] + contact.force)
        assert float(values["base_moment_y_n_mm"]) == pytest.approx(-1e3 * m_y, abs=0.06)
    assert np.std(moments) == pytest.approx(0.01, rel=0.6)
    assert np.std(forces) == pytest.approx(1e-4, rel=0.3)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
def test_an_encoder_counts_whole_steps(tmp_path: Path) -> None:
    file = scene_of(tmp_path, "tolerances: {encoder_step_deg: 0.25}\n")
    for spec in frame_specs(file.scene):
        state = experiment_of(file, spec).states()[0]
        reading = float(readings(file.scene, spec, state, None)["motor_angle_deg"])
        assert reading % 0.25 == pytest.approx(0)
        assert reading == pytest.approx(np.degrees(spec.motor_angle(state.pushing_angle)), abs=0.17)


def test_a_camera_in_the_world_is_not_told_the_motors_angle(tmp_path: Path) -> None:
    file = scene_of(tmp_path, "")
    camera = file.scene.camera.model_copy(update={"mount": "world"})
    scene = file.scene.model_copy(update={"camera": camera})
    spec = frame_specs(scene)[0]
    state = Experiment(scene, true_rig(scene), spec.push, tmp_path).states()[0]
    assert readings(scene, spec, state, None)["motor_angle_deg"] == ""


def test_the_stretch_that_is_hidden_follows_equation_32(tmp_path: Path) -> None:
    extra = (
        "occlusion:\n  kind: [removed, sheet]\n  place: [base, contact, middle, tip]\n"
        "  availability: [1.0, 0.6]\n"
    )
    file = scene_of(tmp_path, extra)
    made = frame_specs(file.scene)
    assert len(made) == 2 * 2 * 4 * 2
    for spec in made:
        experiment = experiment_of(file, spec)
        state = experiment.states()[0]
        stretch = Pose(experiment, spec, state).hidden
        values = readings(file.scene, spec, state, stretch)
        row = truth_row(experiment, spec, state, stretch)
        assert spec.cover is not None
        if spec.cover.availability == 1:
            assert stretch is None
            assert values["removed_from_mm"] == ""
            continue
        assert stretch is not None
        first, last = stretch
        assert (last - first) / 0.24 == pytest.approx(0.4)
        x_c = float(state.contact.point[0])
        inside = {"base": 0.0, "contact": x_c, "middle": 0.12}
        assert first - 1e-12 <= inside.get(spec.cover.place, 0.24) <= last + 1e-12
        # Its middle does not tell where the contact is.
        assert abs((first + last) / 2 - x_c) > 1e-4
        assert row["hidden_from_mm"] == pytest.approx(1e3 * first)
        # A solver is told of data that are removed, never of what lies before the beam.
        removed = spec.cover.kind == "removed"
        assert values["removed_to_mm"] == (pytest.approx(1e3 * last) if removed else "")


def test_a_scene_pays_only_for_what_it_asks(tmp_path: Path) -> None:
    def model(extra: str, pushes: str = "") -> str:
        file = scene_of(tmp_path, extra, pushes)
        return experiment_of(file, frame_specs(file.scene)[0]).model

    assert model("") == PLANAR
    assert model("object: {kind: cylinder}\n") == PLANAR
    assert model("", "  deflection_pct: [10]\n  stiffness_n_m: [20]\n") == PLANAR
    assert model("mechanics: linear\n") == LINEAR
    assert model("gravity_m_s2: [0, 0, -9.81]\n") == SPATIAL
    assert model("beam: {bow_mm: 0.1}\n") == SPATIAL
    assert model("object: {kind: block, friction: 0.1}\n") == SPATIAL
    assert model("clamp_offset_mm: [5, 0, 0]\n") == SPATIAL
    tilted = "  deflection_pct: [5]\n  normal_deg: [20]\n"
    assert model("object: {kind: knife_edge}\n", tilted) == SPATIAL


def test_truth_of_a_frame_before_contact_is_null_where_there_is_none(tmp_path: Path) -> None:
    file = scene_of(tmp_path, "", "  pushing_angle_deg: [-2, 3]\n")
    for spec in frame_specs(file.scene):
        experiment = experiment_of(file, spec)
        state = experiment.states()[spec.step]
        row = truth_row(experiment, spec, state, None)
        assert (row["x_c_mm"] is None) == (spec.step == 0)
        assert (row["force_antenna_n"] is None) == (spec.step == 0)
        assert row["pushing_angle_deg"] == pytest.approx([-2, 3][spec.step])
        assert len(row["centreline_s_mm"]) == 481


def test_truth_of_a_compliant_object_obeys_hooke_and_equation_31(tmp_path: Path) -> None:
    file = scene_of(tmp_path, "", "  pushing_angle_deg: [3]\n  stiffness_n_m: [20]\n")
    for spec in frame_specs(file.scene):
        experiment = experiment_of(file, spec)
        row = truth_row(experiment, spec, experiment.states()[0], None)
        assert row["k_s_n_m"] == 20
        assert row["w_s_mm"] * 1e-3 * 20 == pytest.approx(row["force_n"], rel=5e-3)
        w_p = row["x_c_mm"] * np.tan(np.radians(3))  # (30), mended
        assert w_p - row["y_c_mm"] == pytest.approx(row["w_s_mm"], rel=0.02)


def test_metadata_tells_a_solver_all_that_was_read(dataset: Path, tmp_path: Path) -> None:
    root = tmp_path / "observations"
    shutil.copytree(dataset / "observations", root, ignore=shutil.ignore_patterns("hashes.json"))
    table = sorted(root.glob("shard_*/metadata.csv"))[0]
    rows = list(csv.DictReader(table.read_text().splitlines()))
    more = {
        "removed_from_mm": "10", "removed_to_mm": "20", "moment_y_n_mm": "-1.5",
        "base_force_x_n": "1", "base_force_y_n": "2", "base_force_z_n": "3",
        "base_moment_x_n_mm": "4", "base_moment_y_n_mm": "5", "base_moment_z_n_mm": "6",
    }  # fmt: skip
    columns = [*rows[0], *more]
    text = "\n".join([",".join(columns)] + [",".join({**r, **more}.values()) for r in rows])
    table.write_text(text)
    name = rows[0]["frame_id"]
    frame = next(f for f in open_observations(root) if f.frame_id == name)
    assert frame.readings.removed == pytest.approx((0.01, 0.02))
    assert frame.readings.moment_y == pytest.approx(-1.5e-3)
    assert frame.readings.base_force == pytest.approx((1, 2, 3))
    assert frame.readings.base_moment == pytest.approx((4e-3, 5e-3, 6e-3))
    assert frame.push_id == rows[0]["push_id"]
    table.write_text(text.replace("-1.5", "nan", 1))
    with pytest.raises(InputError, match="moment_y_n_mm is 'nan', allowed is a finite number"):
        open_observations(root)
    table.write_text(text.replace(",20,", ",,", 1))
    with pytest.raises(InputError, match="removed_to_mm is '', allowed is a finite number"):
        open_observations(root)
