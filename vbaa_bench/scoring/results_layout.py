"""Paths of predictions, scores and reports within a dataset.

DATASET/
  predictions/<method>.csv      one row per frame, see solver/lab/table.py; with another centreline
                                than the default, <method>@<centreline>.csv; and a user's own
                                files, CSV or Parquet, unchanged
  scores/scores.parquet, scores.csv, strata.csv, summary.json
  report/report.html and the figures of the README

The column `assumption` of predictions names what a refused image contradicts. It is empty if the
outcome names nothing, and files of older versions do not have it.

Each folder has a hashes.json with the sha256 of the files that a command wrote, see
vbaa_bench/dataset/recorded.py.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from vbaa_bench.dataset.layout import Layout

# Default extraction method of the centreline.
USUAL_CENTRELINE: Final = "profile_fit"


def run_name(method: str, centreline: str = USUAL_CENTRELINE) -> str:
    """Name a method's predictions in files and tables, such as `two_point@area_weighted`.

    Raises InputError if the name contains a path.
    """
    name = method.replace(":", ".")
    if Path(name).name != name:
        raise InputError(f"method '{method}' is not a name or package.module:function")
    return name if centreline == USUAL_CENTRELINE else f"{name}@{centreline}"


@dataclass(frozen=True)
class Results:
    """Paths of a dataset's results."""

    root: Path

    @property
    def dataset(self) -> Layout:
        """The dataset itself."""
        return Layout(self.root)

    @property
    def predictions(self) -> Path:
        """Folder of the methods' predictions."""
        return self.root / "predictions"

    @property
    def scores(self) -> Path:
        """Folder of the scores."""
        return self.root / "scores"

    @property
    def report(self) -> Path:
        """Folder of the report and its figures."""
        return self.root / "report"
