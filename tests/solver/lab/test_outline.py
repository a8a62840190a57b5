"""The command `outline`: tables in, a table out."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

from solver.__main__ import main
from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from solver.lab.outline_command import COLUMNS, outline_csv, read_estimates, summary
from solver.outline.fit import Outline, fit_outline
from tests.command_line import CommandLine
from tests.solver.outline.test_fit import contacts, errors


@pytest.fixture(scope="module")
def outline() -> Outline:
    return fit_outline(contacts(np.linspace(0, 2 * np.pi, 40, endpoint=False)))


def test_the_table_of_an_outline_has_its_points_in_mm(outline: Outline, tmp_path: Path) -> None:
    (tmp_path / "outline.csv").write_text(outline_csv(outline), encoding="utf-8")
    with (tmp_path / "outline.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    table = np.array([[float(row[name]) for name in COLUMNS] for row in rows])
    assert np.radians(table[:, 0]) == pytest.approx(outline.normals)
    assert table[:, 1:3] == pytest.approx(1e3 * outline.points)
    assert table[:, 3] == pytest.approx(1e3 * outline.sigmas)
    assert np.abs(errors(outline)).max() < 1e-3


def test_the_summary_names_what_is_open(outline: Outline) -> None:
    assert "40 contacts, 0 rejected; outline closed" in summary(outline)
    part = fit_outline(contacts(np.linspace(0.1, 3.0, 20)))
    assert "outline open, normals from 6 to 172 degrees" in summary(part)


def test_the_command_finds_a_round_object(
    dataset: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command = CommandLine(main, capfd)
    observations = dataset / "observations"
    image = next(iter(open_observations(observations))).path
    shutil.copy(image, tmp_path)
    # Every contact is at (100, 10) mm of Sigma_o, and the object below it, at 0.4 mm less.
    head = "frame_id,outcome,contact_world_x_mm,contact_world_y_mm,contact_world_x_sigma_mm,"
    head += "contact_world_y_sigma_mm,contact_world_x_y_correlation,force_x_n,force_y_n\n"
    table = "file_name,frame_id,motor_angle_deg,carriage_x_mm,carriage_y_mm,carriage_turn_deg\n"
    radius, estimates, readings = 8.0, head, table
    for turn in range(0, 360, 10):
        cosine, sine = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        x, y = np.array([[cosine, -sine], [sine, cosine]]) @ [-100.0, radius - 9.6]
        estimates += f"{turn},contact,100,10,0.05,0.02,0.1,0,1\n"
        readings += f"{image.name},{turn},0,{x},{y},{turn}\n"
    (tmp_path / "estimates.csv").write_text(estimates, encoding="utf-8")
    (tmp_path / "readings.csv").write_text(readings, encoding="utf-8")
    out = tmp_path / "outline.csv"
    words = ("outline", tmp_path / "estimates.csv", "--rig", observations, "--out", out)
    ended = command(*words, "--readings", tmp_path / "readings.csv")
    assert ended.status == 0, ended
    assert "36 contacts, 0 rejected; outline closed" in ended.out
    with out.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [np.hypot(float(row["x_mm"]), float(row["y_mm"])) for row in rows] == pytest.approx(
        [radius] * 720, abs=0.01
    )


def test_readings_without_a_carriage_are_refused(
    dataset: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    observations, out = dataset / "observations", tmp_path / "outline.csv"
    name = next(iter(open_observations(observations))).frame_id
    (tmp_path / "estimates.csv").write_text(f"frame_id,outcome\n{name},contact\n")
    words = ("outline", tmp_path / "estimates.csv", "--rig", observations, "--out", out)
    assert "have no carriage_x_mm" in CommandLine(main, capfd).refused(*words)
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("outcome\ncontact\n", "the column frame_id is missing"),
        ("frame_id,outcome,x_c_mm\na,contact,inf\n", "x_c_mm is 'inf', allowed is a finite number"),
    ],
)
def test_a_table_that_is_none_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "estimates.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_estimates(tmp_path / "estimates.csv")
