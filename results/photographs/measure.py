"""Solve folders of photographs with the solver's command, and compare with the truth."""

import csv
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from results.photographs.folder import rig_name
from solver.instrument.errors import InputError
from solver.instrument.safe_path import PYTHON
from solver.lab.writing import write
from vbaa_bench.scoring.scored_quantities import CONSISTENT_SIGMAS
from vbaa_bench.scoring.statistics import CONTACTS, MEDIAN, RMS

# Chosen: a joint fit of ten photographs takes seconds, a first start compiles for a minute.
_MOST_SECONDS: Final = 900.0


class Solved(NamedTuple):
    """Photograph with an unknown load: true and estimated force and place, None if not answered.

    `length_mm` and `width_px` are those of the rig's beam, `marks` is whether the folder has marks.
    """

    rig: int
    file: str
    outcome: str
    length_mm: float
    width_px: float
    marks: bool
    force_n: float
    s_c_mm: float
    force_estimate_n: float | None
    force_sigma_n: float | None
    s_c_estimate_mm: float | None
    s_c_sigma_mm: float | None


def solve(number: int, work: Path) -> None:
    """Run the solver's command on a copy of one rig's folder; keep an estimate that exists.

    The child process is given the copy only. Its message is kept in place of a table if it fails.
    Raises InputError if it takes too long.
    """
    name = rig_name(number)
    table, message = (work / "estimates" / f"{name}.{ending}" for ending in ("csv", "txt"))
    if table.exists() or message.exists():
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder, out = Path(scratch) / "photographs", Path(scratch) / "estimates.csv"
        shutil.copytree(work / "rigs" / name, folder)
        command = [*PYTHON, "-m", "solver", "photos", str(folder), "--out", str(out)]
        start = time.monotonic()
        try:
            child = subprocess.run(
                command, capture_output=True, text=True, timeout=_MOST_SECONDS, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise InputError(f"{name}: the solver takes more than {_MOST_SECONDS:g} s") from error
        seconds = time.monotonic() - start
        if out.exists():
            write(table, out.read_bytes())
        else:
            text = child.stderr.strip() or child.stdout.strip()
            write(
                message, f"exit status {child.returncode} after {seconds:.0f} s\n{text}\n".encode()
            )


def compare(number: int, work: Path) -> list[Solved]:
    """Compare the estimates of one rig with the truth, photograph by photograph."""
    name = rig_name(number)
    truth = json.loads((work / "truth" / f"{name}.json").read_text(encoding="utf-8"))
    stated = json.loads((work / "rigs" / name / "photos.json").read_text(encoding="utf-8"))
    rows = _rows(work / "estimates" / f"{name}.csv")
    solved = []
    for photo in truth["photos"]:
        if photo["force_n"] is None or photo["known"]:
            continue
        row = rows.get(photo["file"], {})
        outcome = row.get("outcome", "failed")
        answered = outcome in CONTACTS
        columns = ("force_n", "force_sigma_n", "s_c_mm", "s_c_sigma_mm")
        values = [_number(row.get(column)) if answered else None for column in columns]
        solved.append(
            Solved(
                number,
                photo["file"],
                outcome,
                truth["rig"]["length_mm"],
                truth["rig"]["width_px"],
                "marks" in stated["photos"][0],
                photo["force_n"],
                photo["s_c_mm"],
                *values,
            )
        )
    return solved


def _rows(table: Path) -> dict[str, dict[str, str]]:
    if not table.exists():
        return {}
    with table.open(encoding="utf-8", newline="") as stream:
        return {Path(row["file"]).name: row for row in csv.DictReader(stream)}


def _number(cell: str | None) -> float | None:
    return float(cell) if cell else None


def record(solved: Sequence[Solved]) -> dict[str, Any]:
    """Score some photographs: errors of force [%] and place [% of L], and their honesty.

    A value is honest if its error is within three of its stated sigmas. `sigma_over_rmse` is the
    median of the sigmas over the RMSE.
    """
    force = [
        (100 * (one.force_estimate_n / one.force_n - 1), 100 * one.force_sigma_n / one.force_n)
        for one in solved
        if one.force_estimate_n is not None and one.force_sigma_n is not None
    ]
    place = [
        (
            100 * (one.s_c_estimate_mm - one.s_c_mm) / one.length_mm,
            100 * one.s_c_sigma_mm / one.length_mm,
        )
        for one in solved
        if one.s_c_estimate_mm is not None and one.s_c_sigma_mm is not None
    ]
    count = max(len(solved), 1)
    return {
        "rigs": len({one.rig for one in solved}),
        "photos": len(solved),
        "answered_pct": 100 * len(force) / count,
        **{f"force_{key}": value for key, value in _errors(force).items()},
        **{f"place_{key}": value for key, value in _errors(place).items()},
    }


def _errors(pairs: Sequence[tuple[float, float]]) -> Mapping[str, float]:
    if not pairs:
        return dict.fromkeys(
            ("median_pct", "rmse_pct", "in_3_sigma_pct", "sigma_over_rmse"), np.nan
        )
    errors, sigmas = np.array(pairs).T
    rmse = RMS.of(errors)
    return {
        "median_pct": MEDIAN.of(np.abs(errors)),
        "rmse_pct": rmse,
        "in_3_sigma_pct": 100 * float(np.mean(np.abs(errors) <= CONSISTENT_SIGMAS * sigmas)),
        "sigma_over_rmse": MEDIAN.of(sigmas) / rmse,
    }
