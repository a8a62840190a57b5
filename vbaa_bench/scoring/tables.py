"""Formats of the accuracy table: Markdown, LaTeX and CSV."""

import csv
import io
import re
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from vbaa_bench.scoring.markdown_table import markdown_table
from vbaa_bench.scoring.statistics import HEADINGS

Row = dict[str, Any]

# Headings of the table, and the keys of their numbers in a row.
_COLUMNS: Final = {
    "x_c RMSE, % of L": "x_c_rmse_pct_L",
    "failures as L/2": "x_c_rmse_all_pct_L",
    "median": "x_c_median_abs_pct_L",
    "force, %": "force_rmse_pct",
    "psi, deg": "psi_rmse_deg",
    "psi in 3 sigma, %": "psi_within_3_sigma_pct",
    "1/k at end of push, %": "compliance_last_rmse_pct",
    "1/k at end, rigid, mm/N": "compliance_rigid_last_rmse_mm_per_n",
    "1/k at end in 3 sigma, %": "compliance_last_within_3_sigma_pct",
    "x_c in 3 sigma, %": "x_c_within_3_sigma_pct",
    "sigma / RMSE": "x_c_sigma_over_rmse",
    "second s_c RMSE, % of L": "second_s_c_rmse_pct_L",
    "second force, %": "second_force_rmse_pct",
    "second s_c in 3 sigma, %": "second_s_c_within_3_sigma_pct",
    "second sigma / RMSE": "second_s_c_sigma_over_rmse",
    "second answered, %": "second_answered_pct",
    "second false, %": "second_false_pct",
    "consistent, %": "consistent_pct",
    "x_c in 1.96 sigma, %": "x_c_coverage_95_pct",
    "x_c bias / bound": "x_c_bias_over_limit",
    "x_c RMSE / bound": "x_c_rmse_over_limit",
    "force RMSE / bound": "force_rmse_over_limit",
    "psi RMSE / bound": "psi_rmse_over_limit",
    "1/k RMSE / bound": "compliance_rmse_over_limit",
    "information used, %": "x_c_efficiency_pct",
    "ms": "ms_per_frame_median",
    **{heading: name for name, heading in HEADINGS.items()},
}
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
    columns = {
        head: key
        for head, key in _COLUMNS.items()
        if any(row[key] is not None for row in rows) and (key in _BRIEF or not brief)
    }
    texts = ["scene", *([] if by is None else [by]), "method"]
    lines = []
    for row in rows:
        labels = ["–" if row[key] is None else f"{row[key]}" for key in texts]
        numbers = ["–" if row[key] is None else f"{row[key]:.3g}" for key in columns.values()]
        lines.append([*labels, *numbers, str(row["n"]), _outcomes(row)])
    return _Cells([*texts, *columns, "n", "outcomes"], len(texts), lines)


def _outcomes(row: Row) -> str:
    return ", ".join(f"{count} {outcome}" for outcome, count in row["outcomes"].items())


def _remarks(rows: Sequence[Row]) -> dict[str, str]:
    return {row["scene"]: row["remark"] for row in rows if row["remark"]}


def _latex_line(cells: Sequence[str]) -> str:
    pattern = f"[{re.escape(''.join(_LATEX))}]"
    escaped = [re.sub(pattern, lambda match: _LATEX[match[0]], cell) for cell in cells]
    return f"{' & '.join(escaped)} \\\\"
