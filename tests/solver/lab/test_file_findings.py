"""What `check` finds in the names of a rig's files."""

import shutil
from dataclasses import fields
from pathlib import Path

import pytest

from solver.instrument.hashes import HASHES
from solver.instrument.metadata import COLUMNS, read_frames
from solver.instrument.observation import open_rig_files, tables_beside
from solver.lab.example import EXAMPLE
from solver.lab.file_findings import file_findings


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A copy of the example rig."""
    root = tmp_path / "rig"
    shutil.copytree(EXAMPLE, root, ignore=shutil.ignore_patterns("*.avi", "images"))
    return root


def test_the_files_of_a_complete_rig_have_no_findings(rig: Path) -> None:
    (rig / "rest" / "notes.txt").write_text("lamp on the left")
    (rig / "rest" / ".DS_Store").write_text("")
    assert file_findings(open_rig_files(rig)) == ()


def test_an_image_that_is_not_used_is_named(rig: Path) -> None:
    for name in ("rest/ruhe.png", "rest/rest_07.heic", "calibration/board_00.png", "ground/a.jpg"):
        (rig / name).parent.mkdir(exist_ok=True)
        (rig / name).write_bytes(b"")
    found = file_findings(open_rig_files(rig))
    assert [finding.name for finding in found] == 3 * ["images_unused"]
    assert [finding.message for finding in found] == [
        "not used: calibration/board_00.png; names are view_00.png, view_01.png, ...",
        "not used: rest/rest_07.heic, rest/ruhe.png; names are rest_00.png, rest_01.png, ...",
        "not used: ground/a.jpg; names are ground_00.png, ground_01.png, ...",
    ]


def test_one_image_at_rest_is_few(rig: Path) -> None:
    for path in sorted((rig / "rest").glob("rest_*"))[1:]:
        path.unlink()
    assert [finding.name for finding in file_findings(open_rig_files(rig))] == ["one_rest_image"]


def test_a_first_view_that_is_missing_is_named(rig: Path) -> None:
    (rig / "calibration" / "view_00.png").unlink()
    (finding,) = file_findings(open_rig_files(rig))
    assert finding.name == "first_view_missing"
    assert finding.message.startswith("view_00.png is missing: view_01.png defines plane C")
    (rig / "calibration" / "view_01.png").rename(rig / "calibration" / "view_0.png")
    assert file_findings(open_rig_files(rig)) == ()


def test_a_generated_tree_uses_the_files_that_it_lists(dataset: Path) -> None:
    assert (dataset / "observations" / HASHES).is_file()
    assert file_findings(open_rig_files(dataset / "observations")) == ()


@pytest.mark.parametrize(
    ("column", "meant"),
    [
        ("angle", "motor_angle_deg"),
        ("Motor_Angle", "motor_angle_deg"),
        ("push", "push_id"),
        ("base_forces_x_n", "base_force_x_n"),
        ("operator", None),
        ("temperature_c", None),
        ("force_n", None),
        ("step", None),
    ],
)
def test_a_misspelt_column_is_named_and_the_user_s_own_are_not(
    rig: Path, column: str, meant: str | None
) -> None:
    table = rig / "metadata.csv"
    table.write_text(f"file_name,{column}\na.png,1\n")
    sentence = f"{table}: the column '{column}' is unknown; did you mean {meant}?"
    found = [finding.message for finding in file_findings(open_rig_files(rig), [table])]
    assert found == ([] if meant is None else [sentence])


def test_a_column_whose_known_neighbour_is_there_is_the_user_s_own(rig: Path) -> None:
    table = rig / "metadata.csv"
    table.write_text("file_name,motor_angle_deg,angle\na.png,1,2\n")
    assert file_findings(open_rig_files(rig), [table]) == ()


def test_every_column_of_a_generated_table_is_known(dataset: Path) -> None:
    names = (
        tables_beside(dataset / "observations")[0]
        .read_text(encoding="utf-8")
        .splitlines()[0]
        .split(",")
    )
    assert set(names) <= set(COLUMNS)


def test_every_column_that_is_read_is_known(rig: Path) -> None:
    """A column that is read and not listed would be called misspelt."""
    (rig / "a.png").write_text("")
    (rig / "metadata.csv").write_text(f"{','.join(COLUMNS)}\na.png{',1' * (len(COLUMNS) - 1)}\n")
    (frame,) = read_frames(rig / "metadata.csv")
    readings = frame.readings
    assert None not in [getattr(readings, field.name) for field in fields(readings)]
    assert readings.carriage is not None
    assert readings.carriage.turn_sigma > 0
