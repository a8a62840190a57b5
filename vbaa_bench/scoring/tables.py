"""Formats of the accuracy table: Markdown, LaTeX and CSV."""

import csv
import io
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Final, NamedTuple

from vbaa_bench.scoring.statistics import ADDED, SUMMARY, TABLE

Row = dict[str, Any]

# Figures of the table, in the order of their columns.
_COLUMNS: Final = (
    "x_c_rmse_pct_L",
    "x_c_rmse_all_pct_L",
    "x_c_median_abs_pct_L",
    "force_rmse_pct",
    "psi_rmse_deg",
    "psi_within_3_sigma_pct",
    "compliance_last_rmse_pct",
    "compliance_rigid_last_rmse_mm_per_n",
    "compliance_last_within_3_sigma_pct",
    "x_c_within_3_sigma_pct",
    "x_c_sigma_over_rmse",
    "second_s_c_rmse_pct_L",
    "second_force_rmse_pct",
    "second_s_c_within_3_sigma_pct",
    "second_s_c_sigma_over_rmse",
    "second_answered_pct",
    "second_false_pct",
    "consistent_pct",
    "x_c_coverage_95_pct",
    "x_c_bias_over_limit",
    "x_c_rmse_over_limit",
    "force_rmse_over_limit",
    "psi_rmse_over_limit",
    "compliance_rmse_over_limit",
    "x_c_efficiency_pct",
    "ms_per_frame_median",
    *ADDED,
)
# Those of a brief table.
_BRIEF: Final = (
    "x_c_median_abs_pct_L",
    "x_c_rmse_pct_L",
    "x_c_rmse_over_limit",
    "force_rmse_pct",
    "psi_rmse_deg",
    "x_c_coverage_95_pct",
    "x_c_sigma_over_rmse",
    "ms_per_frame_median",
)
# Characters that LaTeX would interpret, or that its default font lacks.
_LATEX: Final = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    "°": r"$^\circ$",
    "<": "$<$",
    ">": "$>$",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}


class _Cells(NamedTuple):
    """Texts of a table: heads, the number of leading columns that are texts, and lines."""

    heads: list[str]
    texts: int
    lines: list[list[str]]


def markdown(rows: Sequence[Row], by: str | None = None, *, brief: bool = False) -> str:
    """Format the table without empty columns, followed by the remarks on its scenes."""
    table = _cells(rows, by, brief)
    last = len(table.heads) - 1
    text = markdown_table(table.heads, table.lines, {*range(table.texts), last})
    notes = [f"- `{scene}`: {sentence}" for scene, sentence in _remarks(rows).items()]
    return "\n".join([text, "", *notes]) if notes else text


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], texts: Collection[int] = (0,)
) -> str:
    """Format rows of cells below their heads; the columns `texts` are to the left, others right."""
    rule = ["---" if i in texts else "---:" for i in range(len(heads))]
    escaped = ([cell.replace("|", "\\|") for cell in line] for line in (heads, *rows))
    first, *others = (f"| {' | '.join(line)} |" for line in escaped)
    return "\n".join([first, f"| {' | '.join(rule)} |", *others])


def latex(rows: Sequence[Row], by: str | None = None, *, brief: bool = False) -> str:
    """Format the table for LaTeX with the package booktabs; remarks are comments below it.

    A rule separates datasets.
    """
    table = _cells(rows, by, brief)
    columns = "".join("l" if i < table.texts else "r" for i in range(len(table.heads) - 1)) + "l"
    lines = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", _latex_line(table.heads), r"\midrule"]
    for number, line in enumerate(table.lines):
        if number and line[0] != table.lines[number - 1][0]:
            lines.append(r"\midrule")
        lines.append(_latex_line(line))
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [f"% {scene}: {sentence}" for scene, sentence in _remarks(rows).items()]
    return "\n".join(lines)


def csv_table(rows: Sequence[Row], by: str | None = None, *, brief: bool = False) -> str:
    """Format all numbers of the rows as CSV in full precision, with their keys as heads."""
    heads = ["scene", *([] if by is None else [by]), "method", "n"]
    wanted = _BRIEF if brief else rows[0]
    numbers = [key for key in wanted if any(isinstance(row[key], int | float) for row in rows)]
    heads += [key for key in numbers if key not in heads]
    stream = io.StringIO()
    writer = csv.DictWriter(
        stream, [*heads, "outcomes"], extrasaction="ignore", lineterminator="\n"
    )
    writer.writeheader()
    writer.writerows({**row, "outcomes": _outcomes(row)} for row in rows)
    return stream.getvalue().rstrip("\n")


FORMATS: Final[dict[str, Callable[..., str]]] = {
    "markdown": markdown,
    "latex": latex,
    "csv": csv_table,
}


def _cells(rows: Sequence[Row], by: str | None, brief: bool) -> _Cells:
    columns = [
        key
        for key in _COLUMNS
        if any(row[key] is not None for row in rows) and (key in _BRIEF or not brief)
    ]
    heads = [(SUMMARY | TABLE)[key].heading.table for key in columns]
    texts = ["scene", *([] if by is None else [by]), "method"]
    lines = []
    for row in rows:
        labels = ["–" if row[key] is None else f"{row[key]}" for key in texts]
        numbers = ["–" if row[key] is None else f"{row[key]:.3g}" for key in columns]
        lines.append([*labels, *numbers, str(row["n"]), _outcomes(row)])
    return _Cells([*texts, *heads, "n", "outcomes"], len(texts), lines)


def _outcomes(row: Row) -> str:
    return ", ".join(f"{count} {outcome}" for outcome, count in row["outcomes"].items())


def _remarks(rows: Sequence[Row]) -> dict[str, str]:
    return {row["scene"]: row["remark"] for row in rows if row["remark"]}


def _latex_line(cells: Sequence[str]) -> str:
    pattern = f"[{re.escape(''.join(_LATEX))}]"
    escaped = [re.sub(pattern, lambda match: _LATEX[match[0]], cell) for cell in cells]
    return f"{' & '.join(escaped)} \\\\"
