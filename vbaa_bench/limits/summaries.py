"""Maps of limits in a few numbers: spread over the places, and shares that fulfil requirements."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from vbaa_bench.limits.designs import Design
from vbaa_bench.limits.requirements import ACCURACIES, Requirement


class Spread(NamedTuple):
    """Median, smallest and largest limit; None where they cannot be determined."""

    median: float | None
    best: float | None
    worst: float | None


@dataclass(frozen=True)
class Summary:
    """Limits of one design over `reached` of all `places`.

    `spreads` are by the key of the accuracy, such as x_c_pct_L. `fulfilled` are shares of the
    reached places, one for each requirement; `all_fulfilled` is that of all requirements together.
    """

    design: str
    settings: tuple[str, ...]
    reason: str
    places: int
    reached: int
    spreads: dict[str, Spread]
    fulfilled: tuple[float, ...]
    all_fulfilled: float

    def record(self) -> dict[str, Any]:
        """Return the summary for JSON."""
        spreads = {name: spread._asdict() for name, spread in self.spreads.items()}
        return asdict(self) | {"spreads": spreads}


def summaries(
    table: pl.DataFrame, designs: Sequence[Design], requirements: Sequence[Requirement]
) -> list[Summary]:
    """Summarise the map of each design, impossible ones included."""
    return [_summary(table.filter(design=design.name), design, requirements) for design in designs]


def fulfils(requirement: Requirement) -> pl.Expr:
    """Test a limit; false if it cannot be determined, null if the place cannot be reached."""
    limit = pl.col(requirement.accuracy.column)
    answer = (limit <= requirement.most).fill_null(value=False)
    return pl.when(pl.col("force_mn").is_not_null()).then(answer)


def _summary(rows: pl.DataFrame, design: Design, requirements: Sequence[Requirement]) -> Summary:
    reached = rows.filter(pl.col("force_mn").is_not_null())
    answers = [reached.select(fulfils(one)).to_series() for one in requirements]
    together = np.all([answer.to_numpy() for answer in answers], axis=0) if answers else np.ones(0)
    return Summary(
        design=design.name,
        settings=design.settings,
        reason=design.reason,
        places=rows.height,
        reached=reached.height,
        spreads={
            one.key: _spread(reached[one.column])
            for one in ACCURACIES
            if reached[one.column].is_not_null().any()
        },
        fulfilled=tuple(_share(answer.to_numpy()) for answer in answers),
        all_fulfilled=_share(together),
    )


def _spread(limits: pl.Series) -> Spread:
    values = limits.fill_null(np.inf).to_numpy()
    numbers = (np.median(values), values.min(), values.max())
    return Spread(*(float(number) if np.isfinite(number) else None for number in numbers))


def _share(answers: np.ndarray) -> float:
    return float(np.mean(answers)) if answers.size else 0.0
