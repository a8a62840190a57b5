"""From a centreline to a measurement: the tip, the bow, and a camera that has moved."""

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.antenna import Antenna
from solver.at_rest.rest_line import RestLine
from solver.centreline import Centreline, down_columns
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.image_frame import Carriage
from solver.instrument.measurement import Measurement
from solver.instrument.rig import Light
from solver.instrument.transforms import invert, turn_about_z
from solver.methods import Method
from solver.methods.exact_fit import exact_fit
from solver.planes.shading import SHADING, SHADING_SIGMA
from solver.to_measurement import to_measurement
from solver.tracker import PushTracker, extract_centreline
from tests.beam_images import HEIGHT, LENGTH, TIPS, WIDTH, Look, Sensor, bent, distances, drawn
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.laboratory import GUIDE, antenna, antenna_with

SENSOR = Sensor()
TILT = 3e-3


def image(light: Floats, seed: int) -> Grey:
    return SENSOR(light, generator(__name__, seed))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", TIPS)
def test_a_tip_of_any_kind_is_where_the_beam_ends(kind: str) -> None:
    """At rest and bent it looks alike: what it adds to the length is learned at rest."""
    look = Look(tip=kind)
    at_rest = drawn(GUIDE, bent(0.0, tilt=TILT), look)
    lab = antenna([image(at_rest, seed) for seed in (1, 2)])
    assert lab.tip_sigma is not None
    for theta in (0.2, -0.15):
        shape = bent(theta, 0.6, TILT)
        tip = to_measurement(
            lab, extract_centreline(lab, image(drawn(GUIDE, shape, look), 3))
        ).view.tip
        assert tip is not None
        end = invert(lab.antenna_from_beam)[:2] @ [*shape[-1], 0.0, 1.0]
        along = shape[-1] - shape[-20]
        along /= np.hypot(*along)
        off = tip.point - end
        sigma = np.sqrt(along @ tip.covariance @ along + (lab.tip_sigma * LENGTH) ** 2)
        assert abs(off @ along) < MOST_SIGMAS * sigma
        assert sigma < 0.2 * 0.5e-3


def bowed(bow: Floats) -> Antenna:
    """An antenna whose beam at rest has a bow (3,), known exactly, and nothing else in view."""
    return antenna_with(RestLine(0.0, 0.0, bow, np.zeros((5, 5)), LENGTH))


def nothing() -> Centreline:
    return down_columns(np.empty((0, 2)), np.empty(0))


def test_where_nothing_is_seen_there_is_no_bow_to_take_off() -> None:
    lab = bowed(np.array([2e-3, 0.0, 0.0]))
    assert not len(to_measurement(lab, nothing()).points)


@pytest.mark.parametrize("theta", [-0.5, 0.2, 0.5])
@pytest.mark.parametrize("hidden", [0.0, 0.2, 0.4])
def test_a_bow_is_taken_off_although_the_base_is_hidden(
    hidden: float, theta: float, random: np.random.Generator
) -> None:
    """A straight beam bends to `bent`; a bowed one lies off it by the bow, along the normal."""
    lab = bowed(np.array([2e-3, 0.0, 0.0]))
    straight = bent(theta, 0.7)
    s = np.linspace(0, 1, len(straight))
    tangent = np.gradient(straight, axis=0)
    tangent /= np.hypot(*tangent.T)[:, None]
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    shown = GUIDE.pixels(straight + (2e-3 * s**2)[:, None] * normal)
    columns = np.arange(np.ceil(shown[0, 0] + hidden * 280), shown[-1, 0])
    rows = np.interp(columns, shown[:, 0], shown[:, 1])
    rows += 0.01 * random.standard_normal(len(rows))
    line = down_columns(np.column_stack([columns, rows]), np.full(len(rows), 0.01))
    off = distances(to_measurement(lab, line).points, straight[::8])
    assert np.abs(off).max() < 0.05e-3


def test_the_shading_moves_by_this_share_of_the_radius() -> None:
    """The mean of x over a matt cylinder's section, lit from a tangent of 0.1 to its side."""
    x = (np.arange(100_000) + 0.5) / 50_000 - 1
    brightness = np.sqrt(1 - x**2) + 0.1 * x
    assert (brightness @ x) / brightness.sum() == pytest.approx(0.1 * SHADING, rel=1e-4)


@pytest.mark.parametrize("slope", [-1.0, 1.0])
def test_shading_that_turns_with_the_beam_is_taken_off(slope: float) -> None:
    """Light from the tip's side moves a section's middle to where its normal turns from."""
    lab = bowed(np.zeros(3))
    lab = replace(lab, rig=replace(lab.rig, light=Light(slope, 0.2)))
    straight = bent(0.4, 0.7)
    tangent = np.gradient(straight, axis=0)
    turn = np.arctan2(tangent[:, 1], tangent[:, 0])
    normal = np.column_stack([-np.sin(turn), np.cos(turn)])
    radius = 2e-3
    lab = replace(lab, rig=replace(lab.rig, beam=replace(lab.rig.beam, diameter=2 * radius)))
    shift = -slope * SHADING * radius * turn
    shown = GUIDE.pixels(straight + shift[:, None] * normal)
    columns = np.arange(np.ceil(shown[0, 0]), shown[-1, 0])
    rows = np.interp(columns, shown[:, 0], shown[:, 1])
    line = down_columns(np.column_stack([columns, rows]), np.full(len(rows), 0.01))
    measured = to_measurement(lab, line)
    assert np.abs(shift).max() > 3e-4
    # A sixth of the sigma that is stated for it.
    assert np.abs(distances(measured.points, straight[::8])).max() < 0.05 * np.abs(shift).max()
    # One sigma of the slope: that of the rig, and that of the shading itself.
    sigma = np.hypot(*measured.view.shared_errors[:, -2:].T) * np.abs(measured.sigma_vectors[:, 1])
    # A column crosses the beam obliquely: an error along it is larger than one along the normal.
    expected = np.hypot(0.2, SHADING_SIGMA) * np.abs(shift).max() / np.cos(turn[-1])
    assert sigma.max() == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(("across", "expected"), [(0.0, 0.0), (0.5, 0.5 * SHADING), (9.0, 2 / 3)])
def test_light_across_the_beam_hides_its_axis(across: float, expected: float) -> None:
    """The sigma of the contact across the beam, in radii; x_c does not depend on it."""
    lab = bowed(np.zeros(3))
    line = down_columns(GUIDE.pixels(bent(0.2, 0.7)), np.full(len(bent(0.2, 0.7)), 0.01))
    dark, lit = (
        exact_fit(
            to_measurement(replace(lab, rig=replace(lab.rig, light=Light(across=light))), line)
        )
        for light in (0.0, across)
    )
    assert lit.values == dark.values
    assert lit.sigma("x_c_m") == dark.sigma("x_c_m")
    name = "contact_antenna_y_m"
    added = math.sqrt(lit.sigma(name) ** 2 - dark.sigma(name) ** 2)
    assert added == pytest.approx(expected * lab.rig.beam.radius, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("distance", [0.1, 0.3])
def test_shading_that_moves_with_the_beam_below_a_lamp_is_taken_off(distance: float) -> None:
    """Below a lamp over the beam's middle, the parts on either side are lit from there."""
    lab = bowed(np.zeros(3))
    radius = 2e-3
    beam = replace(lab.rig.beam, diameter=2 * radius)
    rig_below = replace(lab.rig, beam=beam, light=Light(0.0, 0.0, distance))
    lab = replace(lab, rig=rig_below)
    straight = bent(0.4, 0.7)
    tangent = np.gradient(straight, axis=0)
    tangent /= np.hypot(*tangent.T)[:, None]
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    # Tangents to the lamp; the telecentric camera sees every part from above.
    towards = (np.array([LENGTH / 2, 0.0]) - straight) / distance
    shift = SHADING * radius * (towards * normal).sum(axis=1)
    shown = GUIDE.pixels(straight + shift[:, None] * normal)
    columns = np.arange(np.ceil(shown[0, 0]), shown[-1, 0])
    rows = np.interp(columns, shown[:, 0], shown[:, 1])
    line = down_columns(np.column_stack([columns, rows]), np.full(len(rows), 0.01))
    measured = to_measurement(lab, line)
    assert np.abs(shift).max() > 2e-5
    assert np.abs(distances(measured.points, straight[::8])).max() < 0.05 * np.abs(shift).max()
    sigma = np.abs(measured.view.shared_errors[:, -1] * measured.sigma_vectors[:, 1])
    assert sigma.max() == pytest.approx(SHADING_SIGMA * np.abs(shift).max(), rel=0.2)


@cache
def scene(du: float, theta: float) -> Floats:
    """Light of a beam before a hub and stones on the ground, all shifted by du [px]."""
    seen_by = replace(GUIDE, camera=replace(GUIDE.camera, cx=GUIDE.camera.cx + du))
    v, u = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    random = generator(__name__, 3)
    ground = np.full(u.shape, 0.05)
    for _ in range(40):
        x, y = random.uniform(10, WIDTH - 10), random.choice([12, 24, 104, 116])
        ground += 0.15 * np.exp(-((u - du - x) ** 2 + (v - y) ** 2) / 2 / 2.0**2)
    return drawn(seen_by, bent(theta, 0.6, TILT), Look(), ground)


def untouched(_measurement: Measurement) -> Estimate:
    """A method that costs no compiling."""
    return Estimate(Outcome.NO_CONTACT, "")


def test_a_frame_of_a_knocked_camera_has_no_values() -> None:
    lab = antenna([image(scene(0.0, 0.0), seed) for seed in (1, 2)])
    still, knocked = (image(scene(du, 0.15), 3) for du in (0.0, 0.5))
    tracker = PushTracker(lab, untouched)
    assert tracker.solve(still).estimate.outcome is Outcome.NO_CONTACT
    estimate = tracker.solve(knocked).estimate
    assert estimate.outcome is Outcome.CAMERA_MOVED
    shift = re.search(r"has shifted by (\S+) px along its rows", estimate.message)
    assert shift is not None
    assert float(shift[1]) == pytest.approx(0.5, abs=0.05)
    assert not estimate.values
    assert tracker.solve(still).estimate.outcome is Outcome.NO_CONTACT


def test_a_shift_that_the_rig_allows_is_measured_and_removed() -> None:
    lab = antenna([image(scene(0.0, 0.0), seed) for seed in (1, 2)])
    tolerances = replace(lab.rig.tolerances, camera_shift_px=0.5)
    shaky = replace(lab, rig=replace(lab.rig, tolerances=tolerances))
    still, knocked = (image(scene(du, 0.15), 3) for du in (0.0, 0.5))
    line = extract_centreline(shaky, knocked)
    assert line.shift == pytest.approx([0.5, 0.0], abs=0.03)
    assert line.points[:, 0].min() == extract_centreline(lab, knocked).points[:, 0].min()
    place = to_measurement(lab, extract_centreline(lab, still)).points
    removed = to_measurement(shaky, line).points
    contained = to_measurement(lab, extract_centreline(lab, knocked)).points
    # The beam is inclined against the image's rows, along which the camera was knocked.
    assert np.median(np.abs(distances(removed, place))) < 0.02 * lab.pixel
    assert np.median(np.abs(distances(contained, place))) > 0.05 * lab.pixel


class Failing:
    """An extractor that fails, as a defect in it would."""

    shading = 1.0
    detector = None

    def __call__(self, _image: Grey) -> Centreline:
        raise ValueError("operands could not be broadcast together")


def singular(_measurement: Measurement) -> Estimate:
    """A method that NumPy refuses: its LinAlgError is a ValueError."""
    np.linalg.inv(np.zeros((2, 2)))
    return Estimate(Outcome.NO_CONTACT, "")


def ended(_measurement: Measurement) -> Estimate:
    raise SystemExit(3)


@pytest.mark.parametrize(
    ("method", "message"),
    [(singular, "LinAlgError: Singular matrix (_linalg.py:"), (ended, "SystemExit: 3 (test_track")],
)
def test_an_error_in_a_method_is_a_crash_with_its_traceback(method: Method, message: str) -> None:
    solution = PushTracker(bowed(np.zeros(3)), method).solve(np.zeros((HEIGHT, WIDTH), np.uint8))
    assert solution.estimate.outcome is Outcome.CRASHED
    assert message in solution.estimate.message
    assert f"in {method.__name__}\n" in solution.traceback


def test_an_error_in_the_extraction_is_a_crash_and_an_unusable_image_is_none() -> None:
    lab = bowed(np.zeros(3))
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    tracker = PushTracker(replace(lab, at_rest=replace(lab.at_rest, extract=Failing())), untouched)
    crashed, small = tracker.solve(image), tracker.solve(image[1:])
    assert crashed.estimate.outcome is Outcome.CRASHED
    assert "could not be broadcast together (test_tracker.py:" in crashed.estimate.message
    assert "raise ValueError" in crashed.traceback
    assert (small.estimate.outcome, small.traceback) == (Outcome.INVALID, "")


def test_update_has_an_outcome_for_every_argument() -> None:
    tracker = PushTracker(bowed(np.zeros(3)), untouched)
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    assert tracker.update(image, motor_angle_deg=1.0).outcome is Outcome.NO_CONTACT
    for reading in (
        {"motor_angle_deg": math.nan},
        {"moment_y_n_mm": math.inf},
        {"base_force_n": [0.0, math.nan, 1.0]},
        {"base_moment_n_mm": [0.0, 1.0, -math.inf]},
    ):
        estimate = tracker.update(image, **reading)
        assert estimate.outcome is Outcome.INVALID
        assert "allowed are finite numbers" in estimate.message
    for strange in ({"motor_angle_deg": "3.2"}, {"base_force_n": [1.0, 2.0]}):
        assert tracker.update(image, **strange).outcome is Outcome.CRASHED
    assert tracker.update([[1, 2], [3]]).outcome is Outcome.CRASHED


def test_readings_of_a_force_sensor_reach_the_method() -> None:
    given: list[Measurement] = []

    def keeps(measurement: Measurement) -> Estimate:
        given.append(measurement)
        return Estimate(Outcome.NO_CONTACT, "")

    PushTracker(bowed(np.zeros(3)), keeps).update(
        np.zeros((HEIGHT, WIDTH), np.uint8),
        base_force_n=np.array([1.0, 2.0, 3.0]),
        base_moment_n_mm=(4.0, 5.0, 6.0),
    )
    assert given[0].base_force == (1.0, 2.0, 3.0)
    assert given[0].base_moment == pytest.approx((4e-3, 5e-3, 6e-3))


def test_a_tracker_fits_the_outline_of_what_it_has_touched() -> None:
    """A disc of 8 mm, touched by a beam at (60, 5) mm of Sigma_o from all sides."""
    point, radius = np.array([0.06, 0.005]), 8e-3
    names = ("contact_world_x_m", "contact_world_y_m", "force_x_n", "force_y_n")
    values = dict(zip(names, (*point, 0.0, 1.0), strict=True))
    covariance = np.diag([1e-5, 1e-5, 1e-3, 1e-3]) ** 2
    contact_estimate = Estimate(Outcome.CONTACT, values=values, covariance=covariance)
    lab = antenna([image(drawn(GUIDE, bent(0.0)), seed) for seed in (1, 2)])
    tracker = PushTracker(lab, lambda _: contact_estimate)
    touched = image(drawn(GUIDE, bent(0.1)), 3)
    with pytest.raises(InputError, match="no frame with the outcome 'contact' had a carriage"):
        tracker.outline()
    for turn in range(0, 360, 20):
        rotation = turn_about_z(math.radians(turn))[:2, :2]
        # The beam's surface, a radius below its axis, touches the disc about the origin.
        x, y = rotation @ ([0.0, radius + lab.rig.beam.radius] - point)
        carriage = Carriage.at(1e3 * x, 1e3 * y, turn)
        estimate = tracker.update(touched, motor_angle_deg=0.0, carriage=carriage)
        assert estimate.outcome is Outcome.CONTACT
        # What a method does not estimate cannot be placed, and is no error.
        alone = PushTracker(lab, lambda _: Estimate(Outcome.CONTACT, values={"x_c_m": 0.06}))
        assert alone.update(touched, motor_angle_deg=0.0, carriage=carriage).values
    outline = tracker.outline()
    assert outline.closed
    assert len(outline.used) == 18
    assert np.hypot(*outline.points.T) == pytest.approx(radius, rel=0.02)
