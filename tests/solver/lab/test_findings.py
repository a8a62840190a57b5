"""What `check` finds in a rig whose rig.json contradicts its images."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.antenna import Antenna
from solver.at_rest.landmarks import Pixels
from solver.calibrate.calibration import Stretch
from solver.instrument.errors import InputError
from solver.instrument.observation import Observations, open_observations
from solver.instrument.rig import Rig
from solver.instrument.rig_json import read_rig, rig_to_json
from solver.instrument.transforms import rigid
from solver.lab.check import calibration_report
from solver.lab.example import EXAMPLE
from solver.lab.findings import findings
from solver.set_up import set_up
from solver.to_measurement import to_measurement
from solver.tracker import extract_centreline


def names(observations: Observations, rig: Rig) -> set[str]:
    antenna = set_up(replace(observations, rig=rig))
    return {finding.name for finding in findings(antenna)}


def longer(rig: Rig) -> Rig:
    return replace(rig, beam=replace(rig.beam, length=1.02 * rig.beam.length))


def shorter(rig: Rig) -> Rig:
    return replace(rig, beam=replace(rig.beam, length=0.83 * rig.beam.length))


def larger_squares(rig: Rig) -> Rig:
    return replace(rig, board=replace(rig.board, square=1.01 * rig.board.square))


def origin_beside_the_clamp(rig: Rig) -> Rig:
    return replace(rig, base_position=rig.base_position + np.array([0.0, 2e-3, 0.0]))


def origin_along_the_beam(rig: Rig) -> Rig:
    return replace(rig, base_position=rig.base_position + np.array([0.1, 0.0, 0.0]))


def thicker(rig: Rig) -> Rig:
    return replace(rig, beam=replace(rig.beam, diameter=4 * rig.beam.diameter))


def in_newton_square_metres(rig: Rig) -> Rig:
    return replace(rig, beam=replace(rig.beam, flexural_rigidity=1e-6 * rig.beam.flexural_rigidity))


def a_thousand_times_stiffer(rig: Rig) -> Rig:
    return replace(rig, beam=replace(rig.beam, flexural_rigidity=1e3 * rig.beam.flexural_rigidity))


def turned_board(rig: Rig) -> Rig:
    turn = rigid(np.array([0.0, 0.0, math.radians(1)]), np.zeros(3))
    return replace(rig, antenna_from_board=turn @ rig.antenna_from_board)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        (longer, "scale_inconsistent"),
        (shorter, "scale_inconsistent"),
        (larger_squares, "scale_inconsistent"),
        (turned_board, "pose_inconsistent"),
        (origin_beside_the_clamp, "pose_inconsistent"),
        (origin_along_the_beam, "scale_inconsistent"),
        (in_newton_square_metres, "rigidity_implausible"),
        (a_thousand_times_stiffer, "rigidity_implausible"),
    ],
)
def test_what_rig_json_states_wrongly_is_found(
    observations: Observations, wrong: object, name: str
) -> None:
    assert callable(wrong)
    assert name in names(observations, wrong(observations.rig))


@pytest.mark.thorough
def test_a_diameter_that_the_rest_images_contradict_is_found() -> None:
    example = open_observations(EXAMPLE)
    assert names(example, example.rig) == set()
    assert "width_inconsistent" in names(example, thicker(example.rig))


@pytest.mark.thorough
def test_a_section_that_does_not_describe_the_images_contradicts_no_diameter() -> None:
    example = open_observations(EXAMPLE)
    antenna = set_up(replace(example, rig=thicker(example.rig)))
    detector = antenna.extract.detector
    assert detector is not None
    assert detector.appearance.knows_section
    # As in images that were enlarged and sharpened: there the section was 1.5 times too wide.
    appearance = replace(detector.appearance, misfit=60.0)
    misfitting = replace(detector, appearance=appearance)
    at_rest = replace(antenna.at_rest, extract=misfitting)
    found = {finding.name for finding in findings(replace(antenna, at_rest=at_rest))}
    assert "width_inconsistent" not in found


def test_a_right_rig_has_no_findings(antenna: Antenna, observations: Observations) -> None:
    assert list(findings(antenna, observations.frames)) == []


def sagging(antenna: Antenna, stated: float, subtracted: bool) -> Antenna:
    """A level beam with a sag of 2 mm, as a bow that was subtracted or as the line through it."""
    rest, rig, sag = antenna.rest, antenna.rig, 2e-3
    if subtracted:
        rest = replace(rest, bow=sag * np.array([2.0, -4 / 3, 1 / 3]))
    else:
        s = np.linspace(0.0, 1.0, 1001)
        slope, offset = np.polyfit(s, sag * (6 * s**2 - 4 * s**3 + s**4) / 3, 1)
        rest = replace(
            rest,
            y_at_clamp=rest.y_at_clamp + offset,
            slope=rest.slope + slope / rig.beam.length,
        )
    return replace(
        antenna,
        rig=replace(rig, sag_in_plane=np.array([0.0, stated])),
        at_rest=replace(antenna.at_rest, line=rest),
    )


@pytest.mark.parametrize("subtracted", [True, False])
def test_a_sag_is_a_finding_unless_it_is_stated(antenna: Antenna, subtracted: bool) -> None:
    assert list(findings(sagging(antenna, 2.2e-3 if subtracted else 2e-3, subtracted))) == []
    (finding,) = findings(sagging(antenna, 0.0, subtracted))
    assert finding.name == ("rest_images_bent" if subtracted else "pose_inconsistent")


@pytest.mark.thorough
def test_an_origin_far_from_the_beam_is_named(observations: Observations) -> None:
    wrong = replace(observations.rig, base_position=np.array([0.0, 0.04, 0.0]))
    with pytest.raises(InputError, match=r"the origin is wrong \(base\.position_mm"):
        set_up(replace(observations, rig=wrong))


def test_the_wrong_side_is_named_if_there_are_pushes(observations: Observations) -> None:
    mirrored = replace(observations, rig=replace(observations.rig, deflects_towards=-1))
    antenna = set_up(mirrored)
    assert list(findings(antenna)) == []  # the beam at rest does not show it
    (finding,) = findings(antenna, observations.frames)
    assert finding.name == "side_inconsistent"
    assert "4 of the first 4 images" in finding.message
    assert "write 1" in finding.message


def test_one_board_view_is_said_to_work_as_in_the_paper(antenna: Antenna) -> None:
    calibration = replace(antenna.calibration, viewpoint_known=False, covariance=None)
    report = calibration_report(replace(antenna, calibration=calibration))
    assert "one board view works with 0 coefficients, as in the paper" in report.meaning


def test_a_board_that_is_not_square_is_named(antenna: Antenna) -> None:
    calibration = replace(antenna.calibration, stretch=Stretch(0.02, 1e-4))
    (finding,) = findings(replace(antenna, calibration=calibration))
    assert finding.name == "board_stretched"
    assert "squares are 2.00 +- 0.01 % taller than wide" in finding.message


def test_copies_of_a_rest_image_are_named(observations: Observations) -> None:
    copied = replace(observations, rest_images=observations.rest_images[:1] * 4)
    assert "rest_images_identical" in names(copied, observations.rig)


def test_a_usual_shift_of_the_camera_is_part_of_the_clamp_s_error(
    observations: Observations, antenna: Antenna, tmp_path_factory: pytest.TempPathFactory
) -> None:
    tolerances = replace(observations.rig.tolerances, camera_shift_px=0.2)
    path = tmp_path_factory.mktemp("rig") / "rig.json"
    path.write_text(rig_to_json(replace(observations.rig, tolerances=tolerances)))
    rig = read_rig(path)
    assert rig.tolerances.camera_shift_px == 0.2
    # An image without landmarks does not show its shift.
    landmarks = antenna.at_rest.landmarks
    none = replace(landmarks, pixels=Pixels._make(column[:0] for column in landmarks.pixels))
    blind = replace(antenna, at_rest=replace(antenna.at_rest, landmarks=none))
    still, moving, seen = (
        to_measurement(one, extract_centreline(one, next(observations.read_rest_images())))
        for one in (blind, replace(blind, rig=rig), replace(antenna, rig=rig))
    )
    variance = (0.2 * antenna.pixel) ** 2
    added = moving.base_covariance - still.base_covariance
    assert np.diag(added) == pytest.approx([variance, variance, 0], rel=1e-6)
    # The shift is the image's: the clamp has not moved.
    assert moving.image_shift - still.image_shift == pytest.approx(added[:2, :2], rel=1e-6)
    # Landmarks show it.
    known = seen.image_shift - still.image_shift
    assert np.linalg.eigvalsh(known)[-1] < variance / 8
