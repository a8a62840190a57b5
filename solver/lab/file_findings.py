"""Consistency checks of the files of a rig: their names and number, and names of columns."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from solver.instrument.errors import quoted
from solver.instrument.hashes import read_hashes
from solver.instrument.images import FORMATS
from solver.instrument.metadata import misspelt_columns
from solver.instrument.observation import IMAGE_NAMES, Observations
from solver.lab.findings import Finding


def file_findings(observations: Observations, tables: Sequence[Path] = ()) -> tuple[Finding, ...]:
    """List files beside rig.json that are hidden or missing, and misspelt columns of `tables`.

    The files of a generated tree are those that it lists. Raises InputError for a table that cannot
    be read.
    """
    columns = (finding for table in tables for finding in _columns(table))
    if read_hashes(observations.root) is not None:
        return tuple(columns)
    return (
        *_unused(observations),
        *_first_view(observations),
        *_one_rest_image(observations),
        *columns,
    )


def _columns(table: Path) -> Iterator[Finding]:
    for name, meant in misspelt_columns(table):
        yield Finding(
            "column_unknown",
            f"{table}: the column {quoted(name)} is unknown; did you mean {meant}?",
        )


def _unused(observations: Observations) -> Iterator[Finding]:
    used = {*observations.board_views, *observations.rest_images, *observations.ground_images}
    for name in IMAGE_NAMES:
        folder, start = name.split("/")
        names = [
            f"{folder}/{path.name}"
            for path in sorted((observations.root / folder).glob("[!.]*"))
            if path not in used and (path.suffix.lower() in FORMATS or path.name.startswith(start))
        ]
        if names:
            yield Finding(
                "images_unused",
                f"not used: {', '.join(names)}; names are {start}00.png, {start}01.png, ...",
            )


def _one_rest_image(observations: Observations) -> Iterator[Finding]:
    if len(observations.rest_images) == 1:
        yield Finding(
            "one_rest_image",
            "there is one image at rest: two or more, each with its own exposure, show the noise "
            "and the bow better",
        )


def _first_view(observations: Observations) -> Iterator[Finding]:
    first = observations.board_views[0]
    if not re.match(r"view_0+(?!\d)", first.name):
        yield Finding(
            "first_view_missing",
            f"view_00{first.suffix} is missing: {first.name} defines plane C; if it is the view in "
            f"plane C, rename it to view_00{first.suffix}",
        )
