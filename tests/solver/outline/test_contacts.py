"""Contacts of estimates, placed on the table of their object."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.image_frame import Carriage, ImageFrame, Readings
from solver.outline.contacts import carriage_contact, contacts_of, placed
from tests.simulated import rig

RIG = rig(board_translation=1e-5, board_rotation=2e-4, encoder=1e-4)
CARRIAGE = Carriage(0.3, -0.1, 0.5 * math.pi, 5e-6, 3e-5)
FRAME = ImageFrame("a", Path("a.png"), Readings(motor_angle=0.1, carriage=CARRIAGE))
ROW: dict[str, Any] = {
    "frame_id": "a",
    "outcome": "contact",
    "contact_world_x_mm": 150.0,
    "contact_world_x_sigma_mm": 0.06,
    "contact_world_y_mm": 20.0,
    "contact_world_y_sigma_mm": 0.05,
    "contact_world_x_y_correlation": 0.3,
    "force_x_n": -0.1,
    "force_y_n": 0.995,
    "motor_angle_deg": None,
}


def test_a_contact_is_on_the_object_where_the_carriage_has_brought_it() -> None:
    found = contacts_of([ROW], [FRAME], RIG)
    # The table's axes are turned by a right angle, and the beam has a radius of 0.4 mm.
    normal = math.atan2(0.995, -0.1) + 0.1 + 0.5 * math.pi
    assert found.normals == pytest.approx([normal])
    touched = np.array([0.3 - 0.02, -0.1 + 0.15]) - 4e-4 * np.array(
        [math.cos(normal), math.sin(normal)]
    )
    assert found.points[0] == pytest.approx(touched)


def test_an_image_that_was_given_by_its_path_is_found_in_the_readings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    by_path = {**ROW, "frame_id": "images/a.png"}
    frame = replace(FRAME, path=tmp_path / "images" / "a.png")
    found = contacts_of([by_path], [frame], RIG)
    assert found.points == pytest.approx(contacts_of([ROW], [FRAME], RIG).points)
    assert found.frame_ids == ("images/a.png",)


def test_the_whole_covariance_is_that_of_the_estimate_and_the_carriage() -> None:
    total = contacts_of([ROW], [FRAME], RIG).total_covariances()[0]
    in_world = np.array([[0.06**2, 0.3 * 0.06 * 0.05], [0.3 * 0.06 * 0.05, 0.05**2]]) * 1e-6
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    by_turn = turn @ [-0.02, 0.15] * 3e-5
    expected = turn @ in_world @ turn.T + 5e-6**2 * np.eye(2) + np.outer(by_turn, by_turn)
    assert total == pytest.approx(expected, abs=1e-16)


def test_an_estimate_without_the_shared_error_keeps_a_positive_covariance() -> None:
    sharp = {**ROW, "contact_world_x_sigma_mm": 1e-3, "contact_world_y_sigma_mm": 1e-3}
    covariance = contacts_of([sharp], [FRAME], RIG).covariances[0]
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_a_motor_angle_of_the_method_is_preferred() -> None:
    row = {**ROW, "motor_angle_deg": 10.0}
    turned, read = (contacts_of([r], [FRAME], RIG) for r in (row, ROW))
    assert turned.normals - read.normals == pytest.approx([math.radians(10) - 0.1])


@pytest.mark.parametrize(
    ("row", "readings", "message"),
    [
        ({"frame_id": "b"}, {}, "the frame b of the estimates is missing in the readings"),
        ({"outcome": "invalid"}, {}, "no frame with the outcome 'contact'"),
        ({"contact_world_x_y_correlation": None}, {}, "has no contact_world_x_y_correlation"),
        ({"contact_world_x_y_correlation": 1.0}, {}, "a correlation of 1, allowed are sigmas > 0"),
        ({"contact_world_x_sigma_mm": 0.0}, {}, "sigmas of 0 and 0.05 mm"),
        ({}, {"carriage": None}, "frame a have no carriage_x_mm"),
        ({}, {"motor_angle": None}, "frame a has no motor angle"),
    ],
)
def test_what_is_missing_is_named(
    row: dict[str, Any], readings: dict[str, Any], message: str
) -> None:
    frame = replace(FRAME, readings=replace(FRAME.readings, **readings))
    with pytest.raises(InputError, match=message):
        contacts_of([{**ROW, **row}], [frame], RIG)


def test_an_estimate_is_placed_as_its_row_of_the_table() -> None:
    names = ("contact_world_x_m", "contact_world_y_m", "force_x_n", "force_y_n")
    off_diagonal = 0.3 * 0.06 * 0.05e-6
    covariance = np.diag([0.06e-3**2, 0.05e-3**2, 1e-6, 1e-6])
    covariance[0, 1] = covariance[1, 0] = off_diagonal
    values = dict(zip(names, (0.15, 0.02, -0.1, 0.995), strict=True))
    estimate = Estimate(Outcome.CONTACT, values=values, covariance=covariance)
    touch = carriage_contact(estimate, FRAME.readings)
    assert touch is not None
    one, other = placed({"a": touch}, RIG), contacts_of([ROW], [FRAME], RIG)
    assert one.points == pytest.approx(other.points)
    assert one.normals == pytest.approx(other.normals)
    assert one.covariances == pytest.approx(other.covariances)
    assert carriage_contact(Estimate(Outcome.NO_CONTACT), FRAME.readings) is None
    assert carriage_contact(estimate, replace(FRAME.readings, carriage=None)) is None


def test_a_carriage_of_no_pose_is_refused() -> None:
    assert Carriage.at(300.0, -100.0, 90.0, 0.005).x == pytest.approx(0.3)
    with pytest.raises(InputError, match="allowed are finite numbers and sigmas"):
        Carriage.at(math.nan, 0.0, 0.0)
