"""Where answers and judgements lie beside a dataset.

DATASET/
  predictions/<method>.csv      one row a frame, as solver/table.py says; of another centreline
                                than the usual one <method>@<centreline>.csv; and files of
                                somebody's own, CSV or Parquet, as they were handed in
  scores/scores.parquet, scores.csv, summary.json
  report/report.html and the figures of the README
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from vbaa_bench.dataset.layout import Layout

# How the beam is measured where nobody asks for another way.
USUAL_CENTRELINE: Final = "profile_fit"


def kept_as(method: str, centreline: str = USUAL_CENTRELINE) -> str:
    """The name of a method's answers in files and tables, such as `two_point@area_weighted`.

    Raises InputError for a method whose name leads elsewhere than to a file beside the others.
    """
    name = method.replace(":", ".")
    if Path(name).name != name:
        raise InputError(f"method '{method}' is no name, nor package.module:function")
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
        """What methods answered."""
        return self.root / "predictions"

    @property
    def scores(self) -> Path:
        """How they were judged."""
        return self.root / "scores"

    @property
    def report(self) -> Path:
        """The page and its figures."""
        return self.root / "report"
