"""Limits where taper, section, clamp, friction or camera are known only to a tolerance."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.stats import halfnorm

from tests.vbaa_bench.limits.experiments import paper_push, push
from vbaa_bench.limits.frame_limits import FrameLimits
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.prior import friction_sigma
from vbaa_bench.limits.push_limits import PushLimits
from vbaa_bench.limits.push_model import push_gradients
from vbaa_bench.render.variant import activate

X_C, FORCE = 0, 2


@pytest.fixture(autouse=True)
def _active(variant: str) -> None:
    activate(variant, 1)


@cache
def stated(**tolerances: Any) -> FrameLimits:
    return push(tolerances={"flexural_rigidity_pct": 1.0, **tolerances})[1]


def planar(frame: FrameLimits) -> Any:
    return next(values for name, values in frame.by_set() if name == "planar")


def test_a_skew_section_turns_a_small_deflection_by_the_skew() -> None:
    (frame,) = push(pushes={"contact_distance_mm": [140], "deflection_pct": [0.2]})
    beams = frame.imaged.neighbours(("section_skew",))["section_skew"]
    change = (beams.ahead.beam.centreline - beams.behind.beam.centreline) / beams.difference
    deflection = frame.imaged.beam.centreline[:, 2]
    np.testing.assert_allclose(np.abs(change[:, 3]), deflection, rtol=2e-3, atol=1e-8)
    np.testing.assert_allclose(change[:, 2], 0.0, atol=2e-3 * deflection.max())


def test_a_soft_clamp_turns_with_the_push_and_against_the_pushing_angle() -> None:
    """A softness c turns the clamp by c F x_c L / EI."""
    keys = {"pushes": {"contact_distance_mm": [140], "deflection_pct": [0.2]}}
    (frame,) = push(tolerances={"clamp_softness": 0.01}, **keys)
    load, rod = frame.imaged.beam, frame.imaged.rod
    point, force = load.points[0], load.forces[0]
    moment = np.cross(point, force)[2] / (rod.force_unit * rod.beam.length)
    beams = frame.imaged.neighbours(("clamp_softness",))["clamp_softness"]
    change = (beams.ahead.beam.centreline - beams.behind.beam.centreline) / beams.difference
    line = frame.imaged.beam.centreline
    np.testing.assert_allclose(change[:, 2], moment * line[:, 1], rtol=2e-3, atol=1e-9)
    of_push = push_gradients(frame.pose.experiment, [frame.pose.state])
    softness = of_push.gradients[0, 1, of_push.names.index("clamp_softness")]
    assert softness == pytest.approx(-moment * of_push.of_angle[0, 1], rel=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("key", "little", "much"),
    [
        ("tip_ratio_pct", 1e-4, 3.0),
        ("bow_mm", 1e-6, 0.5),
        ("friction", 1e-6, 0.2),
        ("clamp_softness", 1e-7, 0.02),
        ("aspect_ratio_pct", 1e-4, 3.0),
        ("camera_shift_px", 1e-6, 0.1),
    ],
)
def test_a_tolerance_raises_the_limits_of_one_image_and_of_a_push(
    key: str, little: float, much: float
) -> None:
    certain = planar(stated())
    np.testing.assert_allclose(planar(stated(**{key: little})), certain, rtol=1e-4)
    quantity = FORCE if key == "aspect_ratio_pct" else X_C
    uncertain = stated(**{key: much})
    assert planar(uncertain)[quantity] > 1.01 * certain[quantity]
    image = dict(uncertain.by_set())["image"]
    both = [uncertain, replace(uncertain)]
    assert list(PushLimits(both).limits())[1][X_C] < image[X_C]


@pytest.mark.thorough
def test_an_uncertain_section_is_an_uncertain_rigidity() -> None:
    """With a section of sigma s in an unknown direction, EI has the sigma s sqrt(3/2)."""
    frame = stated(aspect_ratio_pct=4.0)
    force = frame.imaged.loads[0].normal_force
    certain, uncertain = planar(stated())[FORCE], planar(frame)[FORCE]
    added = np.sqrt(uncertain**2 - certain**2) / force
    assert added == pytest.approx(0.04 * np.sqrt(1.5), rel=0.02)


@pytest.mark.thorough
def test_an_unknown_taper_is_the_limit_of_a_large_tolerance() -> None:
    pushes = {"contact_distance_mm": [140], "deflection_pct": [20]}
    (unknown,) = push(beam={"tip_ratio": 0.99}, pushes=pushes)
    (vague,) = push(beam={"tip_ratio": 0.99}, pushes=pushes, tolerances={"tip_ratio_pct": 80})
    np.testing.assert_allclose(planar(vague), planar(unknown), rtol=1e-3)


def test_learning_from_many_pushes_leaves_the_limit_of_a_known_beam() -> None:
    frame = stated(tip_ratio_pct=3.0)
    push = frame.on_rig
    once = replace(frame, learned=push)
    often = replace(frame, learned=Information(push.names, 1e7 * push.matrix))
    limits = [dict(one.by_set())["learned"][X_C] for one in (once, often)]
    known = planar(stated())[X_C]
    assert known > limits[1] > 0.3 * known  # it also learns clamp and camera
    assert planar(frame)[X_C] > limits[0] > limits[1]
    nothing = replace(frame, learned=Information((), np.zeros((0, 0))))
    np.testing.assert_allclose(dict(nothing.by_set())["learned"], planar(frame))


def test_of_rigid_objects_the_direction_of_friction_is_known() -> None:
    """A coefficient is the half of the normal distribution of a ratio with either sign."""
    either, rigid = (stated(friction=0.2, rigid_objects=known) for known in (False, True))
    assert friction_sigma(either.rig.scene) == 0.2
    assert friction_sigma(rigid.rig.scene) == pytest.approx(halfnorm(scale=0.2).std())
    assert planar(rigid)[X_C] < planar(either)[X_C]


def test_frames_without_stated_shape_have_no_parameters_of_it() -> None:
    frame = paper_push()[0]
    assert "friction_along" not in frame.parameters
    assert "tip_ratio" not in frame.bending


def test_the_slope_of_a_cones_surface_is_no_friction() -> None:
    """The force normal to it is inclined against the axis by radius (tip ratio - 1) / length."""
    pushes = {"contact_distance_mm": [90], "deflection_pct": [5]}
    cone = {"beam": {"tip_ratio": 0.6}, "pushes": pushes, "tolerances": {"tip_ratio_pct": 40}}
    (frame,) = push(**cone)
    slope = 0.4 * frame.imaged.rod.beam.radius / frame.imaged.rod.beam.length
    assert abs(frame.imaged.loads[0].friction[0]) == pytest.approx(slope, rel=0.01)
    assert "friction_along" not in frame.parameters
    # One frame of a push informs on its contact as its image does.
    (limits,) = PushLimits([frame]).limits()
    assert limits[X_C] == pytest.approx(planar(frame)[X_C], rel=1e-3)
    (rubbing,) = push(**cone, object={"kind": "cylinder", "radius_mm": 6, "friction": 0.1})
    assert "friction_along" in rubbing.parameters
