"""Objects as a scene asks for them: what cannot be is said in a sentence."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from solver.instrument.errors import InputError
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.load import load_scene

UNTURNED = "\n  motor_angle_at_contact_deg: [0, 0]"


def planned(folder: Path, extra: str, pushes: str) -> list[list[State]]:
    """The states of every push of a scene that has been planned."""
    path = folder / "scene.yaml"
    text = SMALL_SCENE.replace(
        "  contact_distance_mm: [100, 200]\n  deflection_pct: [10, 20]\n", pushes
    )
    path.write_text(text + extra, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    pushed = dict.fromkeys(spec.push for spec in work.frame_specs)
    return [Experiment(file.scene, work.rig, push, folder).states() for push in pushed]


def at(distance: float, rest: str = "pushing_angle_deg: [3]") -> str:
    return f"  contact_distance_mm: [{distance}]\n  {rest}\n"


@pytest.mark.parametrize(
    ("extra", "pushes", "message"),
    [
        (
            "object: {kind: block, drift_mm: [0, 3, 0]}",
            at(140, "pushing_angle_deg: [0, 0]"),
            "in step 2, before contact the beam would lie 0.003",
        ),
        (
            "object: {kind: block, drift_mm: [0, -5, 0]}",
            at(140, "pushing_angle_deg: [1, 2]"),
            "in step 2, contact is lost",
        ),
        ("object: {kind: cylinder}", at(5), "is 1.539 mm from the motor's axis"),
        ("object: {kind: wall, gap_mm: 2}", "  pushing_angle_deg: [5]\n", "from the motor's axis"),
        (
            "clamp: {flange_radius_mm: 3, jaw_mm: [14, 20, 7]}",
            at(6),
            "the object overlaps the clamp's jaw, allowed is a narrower jaw",
        ),
        ("clamp: {flange_radius_mm: 20}", at(15), "allowed is beyond the flange's radius of 20 mm"),
        ("clamp: {screw_radius_mm: 5}", at(90), "allowed is up to 0.45 of the jaw's length"),
        ("clamp: {flange_thickness_mm: 27}", at(90), "allowed is less than background.distance"),
        ("object: {kind: block, chamfer_mm: 0.4}", at(90), "allowed is less than top_mm and than"),
        (
            "object: {kind: block, top_mm: 1, chamfer_mm: 0.9}",
            at(140, "pushing_angle_deg: [3]\n  normal_deg: [40]"),
            "the beam slides off the end of the object",
        ),
        (
            "object: {kind: block, texture: {kind: image, file: ../x.png}}",
            at(90),
            "object.texture.file ../x.png: is outside of the scene's folder",
        ),
        (
            "clutter: {under_beam: true, top_mm: -3}\ngravity_m_s2: [0, 0, -9.81]",
            at(140),
            "clutter.top_mm is -3, but the beam reaches",
        ),
        ("clutter: {top_mm: -40}", at(140), "allowed is above the background, -30"),
        ("background: {pattern: image}", at(90), "image_file must be given for the pattern image"),
        (
            "object: {kind: wall, gap_mm: 5}",
            "  pushing_angle_deg: [2]\n",
            "it must turn by more than 3.581 degrees",
        ),
        (
            "object: {kind: wall, gap_mm: 6, length_mm: 20}",
            "  pushing_angle_deg: [6]\n",
            "from the object's middle, allowed is up to 10 mm",
        ),
        (
            "object: {kind: knife_edge, half_angle_deg: 79.5}",
            at(140, "deflection_pct: [45]"),
            "into the object's flank",
        ),
        (
            "object: {kind: plunger, free_length_mm: 5}",
            at(180, "pushing_angle_deg: [8]\n  stiffness_n_m: [2]"),
            "the plunger is pressed in by",
        ),
        (
            "background: {distance_mm: 3}\ngravity_m_s2: [0, 0, -9.81]",
            at(140),
            "the beam reaches",
        ),
        ("second_peg: {distance_mm: 250}", at(140), "second_peg.distance_mm is 250"),
        (
            "second_peg: {distance_mm: 190}",
            at(140, "pushing_angle_deg: [-5]"),
            "have passed through obstacle 2",
        ),
        (
            "beam: {section: strip, aspect_ratio: 8}\nobject: {kind: knife_edge}",
            at(140, "pushing_angle_deg: [3]\n  normal_deg: [10]"),
            "needs an edge of the same normal_deg",
        ),
        (
            "beam: {section: strip, aspect_ratio: 8}\nobject: {kind: peg}",
            at(140),
            "a strip needs a single object, block or knife_edge",
        ),
        ("object: {kind: mesh, file: dust.stl}", at(140), "check object.unit_mm"),
        ("object: {kind: mesh, file: open.stl}", at(140), "open.stl"),
    ],
)
def test_what_cannot_stand_there_is_refused(
    tmp_path: Path, extra: str, pushes: str, message: str
) -> None:
    trimesh.creation.box(extents=(1e-3, 1e-3, 1e-3)).export(tmp_path / "dust.stl")
    hollow = trimesh.creation.box(extents=(20, 20, 10))
    hollow.update_faces(np.arange(len(hollow.faces)) > 1)
    hollow.export(tmp_path / "open.stl")
    with pytest.raises(InputError) as caught:
        planned(tmp_path, extra + "\n", pushes)
    assert message in str(caught.value)
    assert all("scene.yaml:" in line for line in str(caught.value).splitlines())


def test_a_beam_comes_to_a_wall_from_afar(tmp_path: Path) -> None:
    extra, pushes = "object: {kind: wall, gap_mm: 5}\n", "  pushing_angle_deg: [-3, 0, 1, 4, 8]\n"
    (states,) = planned(tmp_path, extra, pushes)
    assert [len(state.contacts) for state in states] == [0, 0, 0, 1, 1]
    assert states[4].contact.s < states[3].contact.s


@pytest.mark.parametrize("shift", [0.0, 30.0])
def test_a_mesh_is_touched_at_the_contact_distance(tmp_path: Path, shift: float) -> None:
    ball = trimesh.creation.icosphere(4, 10)
    ball.apply_translation([shift, 0, 0])
    ball.export(tmp_path / "ball.stl")
    extra = "object: {kind: mesh, file: ball.stl}\n"
    ((state,),) = planned(tmp_path, extra, at(140, "deflection_pct: [1]"))
    assert state.contact.s == pytest.approx(0.14, abs=2e-4)


def test_a_beam_on_a_flat_face_leans_on_its_inner_edge(tmp_path: Path) -> None:
    trimesh.creation.box(extents=(20, 20, 10)).export(tmp_path / "box.stl")
    extra = "object: {kind: mesh, file: box.stl}\n"
    (states,) = planned(tmp_path, extra, at(140, "deflection_pct: [4, 8]"))
    ((edge,),) = planned(tmp_path, "", at(140, "deflection_pct: [8]"))
    assert states[1].contact.s == pytest.approx(edge.contact.s, rel=1e-9)
    assert states[1].contact.force == pytest.approx(edge.contact.force, rel=1e-9)


def test_a_beam_hangs_otherwise_where_gravity_lies_in_the_plane(tmp_path: Path) -> None:
    extra = "gravity_m_s2: [0, -9.81, 0]\n"
    (states,) = planned(tmp_path, extra, at(140, f"pushing_angle_deg: [-30, 0]{UNTURNED}"))
    turned, level = states
    assert level.tip[1] == pytest.approx(-4.03e-3, rel=1e-3)
    # Turned by 30 degrees, gravity has cos 30 of itself across the beam, and some along it.
    assert turned.tip[1] == pytest.approx(level.tip[1] * np.cos(np.radians(30)), rel=0.02)
    # Gravity stays where it is in the world, whatever the angle at which the push begins.
    quarter = UNTURNED.replace("0, 0", "90, 90")
    (begun_elsewhere,) = planned(tmp_path, extra, at(140, f"pushing_angle_deg: [2]{quarter}"))
    along = "gravity_m_s2: [-9.81, 0, 0]\n"
    (same,) = planned(tmp_path, along, at(140, f"pushing_angle_deg: [2]{UNTURNED}"))
    assert begun_elsewhere[0].contact.force == pytest.approx(same[0].contact.force, rel=1e-9)
    assert begun_elsewhere[0].tip == pytest.approx(same[0].tip, rel=1e-9)
    assert abs(turned.residual) < 1e-8
