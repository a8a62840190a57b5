"""The error budget of the methods, if `derived/budget.json` was computed."""

from pathlib import Path
from typing import Final, NamedTuple

from pydantic import RootModel

from vbaa_bench.dataset.document import Document, Figure, check_document, read_json
from vbaa_bench.dataset.recorded import exists

# Shares that are no causes: the first and the last of every method.
TOTAL: Final = "total"
REMAINDER: Final = "remainder"


class _Record(Document):
    """Share of one cause, as in the file."""

    bias_pct_L: Figure  # noqa: N815  (a unit, as in the file)
    rmse_pct_L: Figure  # noqa: N815
    low: Figure
    high: Figure


class _Budget(RootModel[dict[str, dict[str, _Record]]]):
    """Shares by method and cause."""


class Share(NamedTuple):
    """Error of x_c that one cause contributes [% of L]; `low` and `high` limit its RMSE.

    The RMSE of a difference of mean squares has its sign: it is negative where causes cancel.
    `width_pct` is the length of its bar, relative to the largest RMSE of all methods.
    """

    cause: str
    bias_pct_L: float  # noqa: N815  (a unit, as in the file)
    rmse_pct_L: float  # noqa: N815
    low: float
    high: float
    width_pct: float


def read_budget(path: Path) -> dict[str, list[Share]]:
    """Read the shares of every method; empty if the file does not exist.

    The total is first, then come the causes, the largest first, and the remainder is last. Causes
    without any error are left out. Raises InputError for a missing or wrong value.
    """
    if not exists(path):
        return {}
    methods = check_document(path, read_json(path), _Budget).root
    largest = max((abs(one.rmse_pct_L) for m in methods.values() for one in m.values()), default=0)
    return {
        name: sorted(
            (
                Share(
                    cause,
                    one.bias_pct_L,
                    one.rmse_pct_L,
                    one.low,
                    one.high,
                    width_pct=100 * abs(one.rmse_pct_L) / (largest or 1),
                )
                for cause, one in causes.items()
                if one.rmse_pct_L
            ),
            key=lambda share: (share.cause != TOTAL, share.cause == REMAINDER, -share.rmse_pct_L),
        )
        for name, causes in methods.items()
    }
