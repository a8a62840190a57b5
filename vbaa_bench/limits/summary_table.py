"""Summaries of maps of limits as rows of text, and an answer for each requirement."""

from collections.abc import Sequence
from typing import NamedTuple

from vbaa_bench.limits.requirements import (
    ACCURACIES,
    COMPLIANCE,
    FORCE,
    PSI,
    RELATIVE_FORCE,
    X_C,
    Accuracy,
    Requirement,
)
from vbaa_bench.limits.summaries import Spread, Summary
from vbaa_bench.report.numbers import percent, short

# Columns of a summary, where the information set has them.
_COLUMNS = (X_C, FORCE, RELATIVE_FORCE, PSI, COMPLIANCE)
# Chosen: what a sentence can hold.
_MOST_NAMES = 3


class SummaryTable(NamedTuple):
    """Heads of columns, and a row for each design."""

    heads: tuple[str, ...]
    rows: list[tuple[str, ...]]


def mapped(requirements: Sequence[Requirement], information: str) -> list[Accuracy]:
    """List what is mapped: required quantities in their units, others in the usual ones."""
    required = {one.accuracy for one in requirements}
    usual = {X_C, FORCE, PSI, COMPLIANCE}
    usual -= {one for one in usual if one.quantity in {other.quantity for other in required}}
    return [one for one in ACCURACIES if one in required | usual and one.exists(information)]


def summary_table(
    summaries: Sequence[Summary], requirements: Sequence[Requirement]
) -> SummaryTable:
    """Write each summary as a row: limits as median (best to worst), then shares in %."""
    shown = [one for one in _COLUMNS if any(one.key in summary.spreads for summary in summaries)]
    heads = [
        "design",
        *(f"{one.quantity}, {one.unit}" for one in shown),
        *(f"{one}, % of places" for one in requirements),
    ]
    heads += ["all, % of places"] if len(requirements) > 1 else []
    rows = []
    for summary in summaries:
        cells = [_range(summary.spreads.get(one.key)) for one in shown]
        shares = [*summary.fulfilled, summary.all_fulfilled][: len(heads) - 1 - len(shown)]
        texts = [percent(share) if summary.reached else "–" for share in shares]
        reached = f"{summary.reached} of {summary.places}" if not summary.reason else "impossible"
        rows.append((summary.design, *cells, *texts, reached))
    return SummaryTable((*heads, "places reached"), rows)


def answers(summaries: Sequence[Summary], requirements: Sequence[Requirement]) -> list[str]:
    """Write a sentence for each requirement: which designs fulfil it at most places."""
    possible = [summary for summary in summaries if summary.reached]
    sentences = []
    for number, requirement in enumerate(requirements):
        best = max((summary.fulfilled[number] for summary in possible), default=0.0)
        names = [summary.design for summary in possible if summary.fulfilled[number] == best]
        up_to = "" if len(possible) == 1 else "up to "
        share = {0.0: "at no place", 1.0: "at all places"}.get(
            best, f"at {up_to}{percent(best)} % of the places"
        )
        where = "" if len(summaries) == 1 or not best else f", with {_listed(names, len(possible))}"
        sentences.append(f"{requirement}: {share}{where}.")
    return sentences


def _listed(names: Sequence[str], count: int) -> str:
    """Name some of `count` designs, unless they are too many for a sentence."""
    if len(names) == count > 1:
        return "any design"
    return " or ".join(names) if len(names) <= _MOST_NAMES else f"{len(names)} of {count} designs"


def _range(spread: Spread | None) -> str:
    if spread is None:
        return "–"
    return f"{short(spread.median)} ({short(spread.best)}–{short(spread.worst)})"
