"""The page of information limits: heat maps over contact distance and deflection, per design."""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import polars as pl

from vbaa_bench.limits.requirements import Accuracy, Requirement
from vbaa_bench.limits.summaries import Summary, fulfils
from vbaa_bench.limits.summary_table import answers, mapped, summary_table
from vbaa_bench.report.numbers import short
from vbaa_bench.report.template import template
from vbaa_bench.scoring.overlay import force_text

# Upper ends of classes of colour are these numbers times powers of ten: the finest of which all
# limits are below the second number after the sixth.
_LADDERS: Final = ((1, 1.5, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,))
_ENDS: Final = 6


class LimitCell(NamedTuple):
    """A place: its limit as text, class of colour, tooltip, answer in words, and sides of the line.

    `level` is None for a blank place, `answer` "" without requirement. `sides` are classes of
    style, for the line between places that fulfil the requirement and others.
    """

    text: str
    level: int | None
    tip: str
    answer: str
    sides: str


@dataclass(frozen=True)
class LimitMap:
    """The map of one accuracy of one design; `rows` are deflections and cells."""

    title: str
    requirement: Requirement | None
    columns: Sequence[str]
    rows: Sequence[tuple[str, Sequence[LimitCell]]]


def limits_page(
    title: str,
    facts: Sequence[str],
    table: pl.DataFrame,
    summaries: Sequence[Summary],
    requirements: Sequence[Requirement],
    information: str,
) -> str:
    """Write the page of a table of `limits.maps`, in HTML without references to other files."""
    shown = mapped(requirements, information)
    ends = {one: class_ends(table[one.column].drop_nulls().to_list()) for one in shown}
    shown = [one for one in shown if ends[one]]
    line = {one.accuracy: one for one in requirements}
    sections = [
        (
            summary,
            [_map(part, one, line.get(one), ends[one]) for one in shown if summary.reached],
            part.drop_nulls("reason").group_by("reason", maintain_order=True).len().rows(),
        )
        for summary in summaries
        for part in [table.filter(design=summary.design)]
    ]
    return template("limits/page.html.jinja").render(
        title=title,
        facts=facts,
        answers=answers(summaries, requirements),
        summary=summary_table(summaries, requirements),
        sections=sections,
        legends=[(_label(one), _legend(ends[one])) for one in shown],
        requirements=requirements,
    )


def class_ends(values: Sequence[float]) -> list[float]:
    """Choose the upper ends of six classes of colour; what is larger is in a seventh."""
    if not values:
        return []
    low, high = min(values), max(values)
    for steps in _LADDERS:
        first = math.floor(math.log10(low))
        ladder = [step * 10.0**power for power in range(first, first + 9) for step in steps]
        start = bisect_left(ladder, low * (1 - 1e-9))
        if high <= ladder[start + _ENDS + 1]:
            break
    return ladder[start : start + _ENDS]


def _label(accuracy: Accuracy) -> str:
    return f"{accuracy.quantity}, {accuracy.unit}"


def _legend(ends: Sequence[float]) -> list[tuple[int, str]]:
    texts = [f"≤ {short(end)}" for end in ends]
    return list(enumerate([*texts, f"> {short(ends[-1])}"]))


def _map(
    table: pl.DataFrame, accuracy: Accuracy, requirement: Requirement | None, ends: Sequence[float]
) -> LimitMap:
    answer = pl.lit(None, pl.Boolean) if requirement is None else fulfils(requirement)
    records = table.with_columns(fulfilled=answer).to_dicts()
    columns = sorted({record["contact_distance_pct_L"] for record in records})
    levels = sorted({record["deflection_pct"] for record in records})
    at = {(one["deflection_pct"], one["contact_distance_pct_L"]): one for one in records}
    rows = []
    for row, level in enumerate(levels):
        cells = []
        for column, distance in enumerate(columns):
            here = at[level, distance]
            right = at[level, columns[column + 1]] if column + 1 < len(columns) else here
            below = at[levels[row + 1], distance] if row + 1 < len(levels) else here
            sides = [
                name
                for name, other in (("right-line", right), ("lower-line", below))
                if None not in (here["fulfilled"], other["fulfilled"])
                and here["fulfilled"] != other["fulfilled"]
            ]
            cells.append(_cell(here, accuracy, ends, sides))
        rows.append((f"{level:g} %", cells))
    return LimitMap(_label(accuracy), requirement, [f"{value:g}" for value in columns], rows)


def _cell(
    record: Mapping[str, Any], accuracy: Accuracy, ends: Sequence[float], sides: Sequence[str]
) -> LimitCell:
    if record["force_mn"] is None:
        return LimitCell("", None, record["reason"] or "", "", "")
    value = record[accuracy.column]
    answer = {None: "", True: "yes", False: "no"}[record["fulfilled"]]
    tip = (
        f"contact at {short(record['contact_distance_mm'], 3)} mm, "
        f"force {force_text(record['force_mn'] / 1e3)}"
    )
    if value is None:
        return LimitCell("∞", None, f"{tip}: cannot be determined", answer, " ".join(sides))
    tip = f"{accuracy.quantity} {short(value, 3)} {accuracy.unit}; {tip}"
    return LimitCell(short(value), bisect_left(ends, value), tip, answer, " ".join(sides))
