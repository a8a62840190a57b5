"""The table of what learning the beam is worth: errors of frames in, lines and numbers out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.scoring.scored_quantities import CONSISTENT_SIGMAS
from vbaa_bench.scoring.statistics import MEDIAN, RMS
from vbaa_bench.scoring.tables import markdown_table


@dataclass(frozen=True)
class Errors:
    """Errors of one method on a scene: `rows` (n, 7) of the answered of `frames` frames.

    Only frames with a true contact count. The columns are the errors of x_c and its sigma [% of the
    length], of the force and its sigma [%], the information limit of x_c [% of the length], NaN
    where none was computed, and the distance of the contact in Sigma_o from the true one [m], and
    in sigmas (the larger of x and y), NaN where it was not estimated.
    """

    scene: str
    beam: str
    frames: int
    rows: Floats

    def line(self) -> tuple[str, ...]:
        """Format as a line of a table, in the order of HEADS."""
        numbers = zip(self.numbers(), _FORMATS, strict=True)
        texts = ("-" if number is None else f"{number:{form}}" for number, form in numbers)
        return (self.scene, self.beam, str(self.frames), *texts)

    def record(self) -> dict[str, str | float | None]:
        """Return the line's numbers by HEADS; None where there is none."""
        line = (self.scene, self.beam, self.frames, *self.numbers())
        return dict(zip(HEADS, line, strict=True))

    def numbers(self) -> list[float | None]:
        """Compute the numbers of HEADS but the first three; None where there is none."""
        answered = len(self.rows) / self.frames / PERCENT
        if not len(self.rows):
            return [answered, *[None] * (len(_FORMATS) - 1)]
        x, x_sigma, force, force_sigma, limit, distance, sigmas = np.asarray(self.rows).T
        limited, located = np.isfinite(limit), np.isfinite(distance)
        rmse = RMS.of(x)
        numbers = [
            answered,
            rmse,
            MEDIAN.of(np.abs(x)),
            np.mean(np.abs(x) <= CONSISTENT_SIGMAS * x_sigma) / PERCENT,
            RMS.of(x_sigma) / rmse,
            RMS.of(limit[limited]) if limited.any() else None,
            MEDIAN.of((np.abs(x) / limit)[limited]) if limited.any() else None,
            MEDIAN.of((x_sigma / limit)[limited]) if limited.any() else None,
            RMS.of(force),
            np.mean(np.abs(force) <= CONSISTENT_SIGMAS * force_sigma) / PERCENT,
            RMS.of(distance[located]) / MILLIMETRE if located.any() else None,
            np.mean(sigmas[located] <= CONSISTENT_SIGMAS) / PERCENT if located.any() else None,
        ]
        return [None if number is None else float(number) for number in numbers]


HEADS: Final = (
    "dataset",
    "beam",
    "frames",
    "answered, %",
    "RMSE of x_c, % of L",
    "median",
    "within 3 sigma, %",
    "sigma / RMSE",
    "limit, % of L",
    "error / limit, median",
    "sigma / limit, median",
    "RMSE of force, %",
    "force within 3 sigma, %",
    "contact in Sigma_o, RMSE mm",
    "this within 3 sigma, %",
)
# Of the numbers, which begin with the fourth head.
_FORMATS: Final = (
    ".0f", ".3f", ".3f", ".0f", ".2f", ".3f", ".2f", ".2f", ".2f", ".0f", ".3f", ".0f",
)  # fmt: skip


def markdown(results: Sequence[Errors], command: str) -> str:
    """Format results as a page with the command that makes it."""
    table = markdown_table(HEADS, (one.line() for one in results), (0, 1))
    return f"# Learning the beam\n\n```sh\n{command}\n```\n\n{table}\n"
