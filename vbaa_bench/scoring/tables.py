"""Formats of the accuracy table: Markdown, LaTeX and CSV."""

import csv
import io
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Final, NamedTuple

from vbaa_bench.scoring.statistics import ADDED, MEDIAN, P95, RMS, SUMMARY, TABLE

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
BRIEF: Final = (
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


# Typical errors and times, of which the smallest of a scene can be set in bold.
_ERRORS: Final = {
    name for name, one in (SUMMARY | TABLE).items() if one.reduction in (MEDIAN, P95, RMS)
}


class Shown(NamedTuple):
    """What a table shows of its rows.

    `by` is the condition that splits them, `columns` are names of figures in the order of the
    table, all by default. With `bold` the smallest error or time of a scene, and of a value of the
    condition, is in bold, with all that have the same digits.
    """

    by: str | None = None
    columns: Sequence[str] | None = None
    bold: bool = False


class _Cells(NamedTuple):
    """Texts of a table: heads, the number of leading columns that are texts, and lines.

    `bold` are the places in bold, as numbers of line and column.
    """

    heads: list[str]
    texts: int
    lines: list[list[str]]
    bold: set[tuple[int, int]]

    def written(self, escape: Callable[[str], str], bold: str) -> list[list[str]]:
        """Return the lines with escaped cells; `bold` has braces in place of a text in bold."""
        return [
            [
                bold.replace("{}", escape(cell)) if (i, j) in self.bold else escape(cell)
                for j, cell in enumerate(line)
            ]
            for i, line in enumerate(self.lines)
        ]


def markdown(rows: Sequence[Row], shown: Shown) -> str:
    """Format the table without empty columns, followed by the remarks on its scenes."""
    table = _cells(rows, shown)
    last = len(table.heads) - 1
    lines = table.written(str, "**{}**")
    text = markdown_table(table.heads, lines, {*range(table.texts), last})
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


def latex(rows: Sequence[Row], shown: Shown) -> str:
    """Format the table for LaTeX with the package booktabs; remarks are comments below it.

    A rule separates datasets.
    """
    table = _cells(rows, shown)
    columns = "".join("l" if i < table.texts else "r" for i in range(len(table.heads) - 1)) + "l"
    heads = [_escaped(head) for head in table.heads]
    lines = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", _latex_line(heads), r"\midrule"]
    for number, line in enumerate(table.written(_escaped, r"\textbf{{}}")):
        if number and line[0] != _escaped(table.lines[number - 1][0]):
            lines.append(r"\midrule")
        lines.append(_latex_line(line))
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [f"% {scene}: {sentence}" for scene, sentence in _remarks(rows).items()]
    return "\n".join(lines)


def csv_table(rows: Sequence[Row], shown: Shown) -> str:
    """Format the numbers of the rows as CSV in full precision, with their keys as heads."""
    heads = ["scene", *([] if shown.by is None else [shown.by]), "method", "n"]
    wanted = rows[0] if shown.columns is None else shown.columns
    numbers = [key for key in wanted if any(isinstance(row[key], int | float) for row in rows)]
    heads += [key for key in numbers if key not in heads]
    stream = io.StringIO()
    writer = csv.DictWriter(
        stream, [*heads, "outcomes"], extrasaction="ignore", lineterminator="\n"
    )
    writer.writeheader()
    writer.writerows({**row, "outcomes": _outcomes(row)} for row in rows)
    return stream.getvalue().rstrip("\n")


FORMATS: Final[dict[str, Callable[[Sequence[Row], Shown], str]]] = {
    "markdown": markdown,
    "latex": latex,
    "csv": csv_table,
}


def _cells(rows: Sequence[Row], shown: Shown) -> _Cells:
    wanted = _COLUMNS if shown.columns is None else shown.columns
    columns = [key for key in wanted if any(row[key] is not None for row in rows)]
    declared = SUMMARY | TABLE
    heads = [(declared[key].heading.table if key in declared else "") or key for key in columns]
    texts = ["scene", *([] if shown.by is None else [shown.by]), "method"]
    lines = []
    for row in rows:
        labels = ["–" if row[key] is None else f"{row[key]}" for key in texts]
        numbers = ["–" if row[key] is None else f"{row[key]:.3g}" for key in columns]
        lines.append([*labels, *numbers, str(row["n"]), _outcomes(row)])
    bold = _smallest(rows, texts[:-1], columns, lines) if shown.bold else set()
    return _Cells([*texts, *heads, "n", "outcomes"], len(texts), lines, bold)


def _smallest(
    rows: Sequence[Row], keys: Sequence[str], columns: Sequence[str], lines: list[list[str]]
) -> set[tuple[int, int]]:
    """Find the smallest error of the methods with equal `keys`, and those with its digits."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    for i, row in enumerate(rows):
        if row["outcomes"]:  # of a method, not of a limit
            groups.setdefault(tuple(row[key] for key in keys), []).append(i)
    found = set()
    for members in groups.values():
        for j, key in enumerate(columns, len(keys) + 1):
            known = [i for i in members if rows[i][key] is not None]
            if key in _ERRORS and known:
                best = min(known, key=lambda i: abs(rows[i][key]))
                found |= {(i, j) for i in known if lines[i][j] == lines[best][j]}
    return found


def _outcomes(row: Row) -> str:
    return ", ".join(f"{count} {outcome}" for outcome, count in row["outcomes"].items())


def _remarks(rows: Sequence[Row]) -> dict[str, str]:
    return {row["scene"]: row["remark"] for row in rows if row["remark"]}


def _latex_line(cells: Sequence[str]) -> str:
    return f"{' & '.join(cells)} \\\\"


def _escaped(cell: str) -> str:
    """Escape the characters that LaTeX would interpret."""
    pattern = f"[{re.escape(''.join(_LATEX))}]"
    return re.sub(pattern, lambda match: _LATEX[match[0]], cell)
