"""Read metadata.csv, the table of a shard's frames.

Columns: file_name, frame_id (by default the file's stem) and motor_angle_deg, which
is empty if there is no encoder. Optional columns: push_id and step (frames of one push, in order),
split ("learn" for those from which the beam is learned),
removed_from_mm and removed_to_mm (an interval of Sigma_a's x axis to be left out), moment_y_n_mm
(the moment sensor), base_force_{x,y,z}_n and base_moment_{x,y,z}_n_mm (the force sensor: force and
moment of the clamp on the beam, in Sigma_a), carriage_x_mm, carriage_y_mm and carriage_turn_deg
(the pose of Sigma_o on the table of the object), and their errors carriage_sigma_mm and
carriage_turn_sigma_deg.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.csv_table import CsvRow, csv_rows
from solver.instrument.errors import InputError, quoted, similar_name, truncated
from solver.instrument.image_frame import Carriage, ImageFrame, Readings
from solver.instrument.units import DEGREE, MILLIMETRE

# Longest name in a table. Chosen: file names can have 255 characters, suffix included.
MAX_NAME_LENGTH: Final = 250
COLUMNS: Final = (
    "file_name",
    "frame_id",
    "motor_angle_deg",
    "push_id",
    "step",
    "split",
    "removed_from_mm",
    "removed_to_mm",
    "moment_y_n_mm",
    *(f"base_force_{axis}_n" for axis in "xyz"),
    *(f"base_moment_{axis}_n_mm" for axis in "xyz"),
    "carriage_x_mm",
    "carriage_y_mm",
    "carriage_turn_deg",
    "carriage_sigma_mm",
    "carriage_turn_sigma_deg",
)


class MisspeltColumn(NamedTuple):
    """Column of a table that is not known, and the absent one that it seems to be."""

    name: str
    meant: str


def misspelt_columns(table: Path) -> list[MisspeltColumn]:
    """List the columns of a metadata.csv that seem to be misspelt. Raises InputError.

    A column is misspelt if it is similar to one of COLUMNS that the table does not have, or is a
    part of a single one of them, as `angle` is of `motor_angle_deg`.
    """
    row = next(csv_rows(table), None)
    names = [] if row is None else [name for name in row.cells if name]
    absent = [column for column in COLUMNS if column not in names]
    misspelt = []
    for name in (name for name in names if name not in COLUMNS):
        whole = [column for column in absent if f"_{name.lower()}_" in f"_{column}_"]
        meant = whole[0] if len(whole) == 1 else similar_name(name.lower(), absent)
        if meant is not None:
            misspelt.append(MisspeltColumn(name, meant))
    return misspelt


def read_frames(table: Path) -> Iterator[ImageFrame]:
    """Read the frames of a metadata.csv, which is in the folder of their images.

    It is any table that `csv_rows` reads. Raises InputError.
    """
    for row in csv_rows(table):
        if "file_name" not in row.cells:
            similar = similar_name("file_name", [name for name in row.cells if name])
            hint = f"; did you mean it by {quoted(similar)}?" if similar else ""
            raise InputError(f"{table}: the column file_name is missing{hint}")
        path = _image(row, table.parent)
        removed = _quantities(row, "removed_from_mm", "removed_to_mm")
        if removed is not None and removed[0] > removed[1]:
            row.refuse(
                f"removed_from_mm is {removed[0] / MILLIMETRE:g} and removed_to_mm "
                f"{removed[1] / MILLIMETRE:g}, allowed is from low to high"
            )
        readings = Readings(
            motor_angle=_quantity(row, "motor_angle_deg"),
            removed=None if removed is None else (removed[0], removed[1]),
            moment_y=_quantity(row, "moment_y_n_mm"),
            base_force=_vector(row, "base_force_{}_n"),
            base_moment=_vector(row, "base_moment_{}_n_mm"),
            carriage=_carriage(row),
        )
        yield ImageFrame(
            frame_id=_name(row, "frame_id") or path.stem,
            path=path,
            readings=readings,
            push_id=_name(row, "push_id"),
            step=_count(row, "step"),
            split=_name(row, "split"),
        )


def _image(row: CsvRow, folder: Path) -> Path:
    """Return the path of the row's image, which is in `folder` or a subfolder."""
    value = row.cells.get("file_name")
    if not value:
        row.refuse("file_name is missing")
    path = Path(value)
    if path.is_absolute() or ".." in path.parts:
        row.refuse(f"file_name is {quoted(value)}, allowed is a file beside the table")
    try:
        exists = (folder / path).is_file()
        # Links are rare, and resolving every path would take longer than reading the table.
        parts = [folder / path, *(folder / part for part in path.parents[:-1])]
        linked = any(part.is_symlink() for part in parts)
    except OSError:  # an invalid file name
        exists = linked = False
    if not exists:
        row.refuse(f"the image {truncated(path.name)} is missing")
    if linked and not (folder / path).resolve().is_relative_to(folder.resolve()):
        row.refuse(
            f"file_name is {quoted(value)}, a link to another folder, allowed is a file beside the "
            "table"
        )
    return folder / path


def _carriage(row: CsvRow) -> Carriage | None:
    """Read the pose of a carriage; None if its cells are empty. Sigmas are 0 where empty."""
    pose = _quantities(row, "carriage_x_mm", "carriage_y_mm", "carriage_turn_deg")
    sigma = _quantity(row, "carriage_sigma_mm") or 0.0
    turn_sigma = _quantity(row, "carriage_turn_sigma_deg") or 0.0
    if min(sigma, turn_sigma) < 0:
        row.refuse(
            f"carriage_sigma_mm is {sigma / MILLIMETRE:g} and carriage_turn_sigma_deg "
            f"{turn_sigma / DEGREE:g}, allowed is >= 0"
        )
    if pose is None:
        return None
    x, y, turn = pose
    return Carriage(x, y, turn, sigma, turn_sigma)


def _name(row: CsvRow, column: str) -> str:
    """Read a short text; return an empty one if there is none."""
    value = row.cells.get(column, "")
    if len(value) > MAX_NAME_LENGTH:
        row.refuse(f"{column} has {len(value)} characters, allowed are {MAX_NAME_LENGTH}")
    return value


def _count(row: CsvRow, column: str) -> int:
    """Read a whole number from 0; an empty cell is 0."""
    value = _quantity(row, column) or 0.0
    if value < 0 or value != int(value):
        row.refuse(f"{column} is {value:g}, allowed is a whole number >= 0")
    return int(value)


def _quantity(row: CsvRow, column: str) -> float | None:
    """Read a finite number, in SI units; return None if the cell is empty."""
    values = _quantities(row, column)
    return None if values is None else values[0]


def _vector(row: CsvRow, column: str) -> tuple[float, float, float] | None:
    """Read x, y and z, which replace {} in `column`, in SI units; None if all are empty."""
    values = _quantities(row, *map(column.format, "xyz"))
    return None if values is None else (values[0], values[1], values[2])


def _quantities(row: CsvRow, *columns: str) -> list[float] | None:
    """Read finite numbers of columns that belong together, in SI units; None if all are empty."""
    if not any(row.cells.get(column) for column in columns):
        return None
    allowed = "a finite number, with a decimal point"
    return [row.quantity(column, allowed) for column in columns]
