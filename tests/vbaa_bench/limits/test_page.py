"""The page of information limits: line and words of a requirement, classes of colour, browser."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from tests.vbaa_bench.limits.synthetic import DESIGNS, table
from tests.vbaa_bench.report.test_browser import BROWSER, browse
from vbaa_bench.limits.page import class_ends, limits_page
from vbaa_bench.limits.requirements import requirements
from vbaa_bench.limits.summaries import Summary, summaries
from vbaa_bench.limits.summary_table import answers, summary_table

REQUIRED = requirements(["x_c_pct_L=0.2,force_mn=0.3"], "image")


def rows() -> list[Summary]:
    impossible = replace(DESIGNS[0], name="300", reason="too long")
    return summaries(table(), [*DESIGNS, impossible], REQUIRED)


@pytest.fixture(scope="module")
def html() -> str:
    return limits_page("Limits of <one>", ["A fact."], table(), rows(), REQUIRED, "image")


def cells(html: str, title: str) -> list[list[tuple[str, str, str]]]:
    """Return class, number and answer of each cell of the first map with a title."""
    body = html.partition(f"<span>{title}")[2].partition("</tbody>")[0]
    pattern = r'<td class="([^"]*)"[^>]*>([^<]*)(?:<span class="aside"> (\w+)</span>)?</td>'
    return [re.findall(pattern, line) for line in body.split("<tr>")[2:]]


def test_a_line_separates_places_that_fulfil_a_requirement(html: str) -> None:
    for line in cells(html, "force, mN; line at 0.3")[:2]:
        (left, number, no), (middle, _, yes), *_ = line
        assert (number, no, yes) == ("0.5", "no", "yes")
        assert "right-line" in left
        assert "yes" in middle.split()
        assert "line" not in middle
    blank = cells(html, "force, mN; line at 0.3")[1][2]
    assert blank == ("  ", "", "")


def test_all_designs_share_classes_of_colour(html: str) -> None:
    (line,) = {one.group(0) for one in re.finditer(r"x_c, % of L: .*", html)}
    assert re.findall(r'<span class="q(\d)">(.*?)</span>', line) == [
        ("0", "≤ 0.1"),
        ("1", "≤ 0.15"),
        ("2", "≤ 0.2"),
        ("3", "≤ 0.3"),
        ("4", "≤ 0.5"),
        ("5", "≤ 0.7"),
        ("6", "&gt; 0.7"),
    ]


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([0.3], [0.3, 0.5, 0.7, 1, 1.5, 2]),
        ([0.001, 0.05], [0.001, 0.002, 0.005, 0.01, 0.02, 0.05]),
        ([0.001, 0.9], [0.001, 0.003, 0.01, 0.03, 0.1, 0.3]),
        ([0.001, 1e5], [0.001, 0.01, 0.1, 1, 10, 100]),
        ([], []),
    ],
)
def test_classes_of_colour_cover_all_limits(values: list[float], ends: list[float]) -> None:
    assert class_ends(values) == pytest.approx(ends)


def test_an_impossible_design_and_blank_places_state_their_reasons(html: str) -> None:
    assert "Not possible: too long" in html
    assert "<li>the camera &lt;sees&gt; nothing</li>" in html
    assert "Limits of &lt;one&gt;" in html


def test_answers_name_the_best_designs() -> None:
    assert answers(rows(), REQUIRED) == [
        "x_c ≤ 0.2 % of L: at all places, with 200.",
        "force ≤ 0.3 mN: at up to 60 % of the places, with any design.",
    ]
    assert answers(rows()[:1], REQUIRED)[1] == "force ≤ 0.3 mN: at 60 % of the places."
    two = rows()[:2]
    many = [replace(two[i == 0], design=f"{i}") for i in range(5)]
    assert answers(many, REQUIRED)[0] == "x_c ≤ 0.2 % of L: at all places, with 4 of 5 designs."
    nowhere = requirements(["x_c_pct_L=0.01"], "image")
    assert answers(summaries(table(), DESIGNS, nowhere), nowhere) == [
        "x_c ≤ 0.01 % of L: at no place."
    ]


def test_a_row_has_limits_shares_and_places() -> None:
    heads, lines = summary_table(rows(), REQUIRED)
    assert heads[:4] == ("design", "x_c, % of L", "force, mN", "force, %")
    assert heads[-2:] == ("all, % of places", "places reached")
    assert lines[0][:2] == ("200", "0.2 (0.1–0.2)")
    assert lines[0][-4:] == ("100", "60", "60", "5 of 6")
    assert lines[2] == ("300", *["–"] * 7, "impossible")


_PROBE = """
<script>
const cells = [...document.querySelectorAll(".map td[class^=q]")];
parent.postMessage({
  width: innerWidth,
  overflow: document.documentElement.scrollWidth - innerWidth,
  cells: cells.length,
  cut: cells.filter((cell) => cell.scrollWidth > cell.clientWidth + 1).length,
  words: document.querySelector(".map .aside").getBoundingClientRect().width,
  fetched: performance.getEntriesByType("resource").length,
}, "*");
</script>
"""


@pytest.mark.thorough
@pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed")
def test_the_page_fits_a_narrow_and_a_wide_window(html: str, tmp_path: Path) -> None:
    # The page itself has no script.
    scripted = html.replace("style-src", "script-src 'unsafe-inline'; style-src")
    found, console = browse(scripted, tmp_path, _PROBE)
    assert console == ""
    assert [one["width"] for one in found] == [390, 1400]
    for one in found:
        assert one["overflow"] <= 0
        # Two designs with three maps of five places, of which one has no psi.
        assert (one["cells"], one["cut"], one["fetched"]) == (2 * (3 * 5 - 1), 0, 0)
        assert one["words"] <= 1
