"""Structure of the page: what a reader, a screen reader and a printer need."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.regression.runs import Drawn, changed
from tests.vbaa_bench.report.synthetic import METHODS, contents, limited, scores
from vbaa_bench.regression.baseline import read_baseline, versions, write_baseline
from vbaa_bench.regression.cells import PairedScene
from vbaa_bench.regression.comparison import table
from vbaa_bench.regression.scored_run import pair
from vbaa_bench.report.budget import read_budget
from vbaa_bench.report.changes import changes_of
from vbaa_bench.report.page import page
from vbaa_bench.report.residuals import MAX_DOTS

VOID = {"meta", "link", "br", "img", "input"}


class Reader(HTMLParser):
    """Elements of a page with their attributes and those of the elements around them."""

    def __init__(self) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str], list[str]]] = []
        self._open: list[str] = []
        self.unbalanced: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}, list(self._open)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}, list(self._open)))

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open.pop() != tag:
            self.unbalanced.append(tag)

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes, _ in self.elements if name == tag]


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    assert reader.unbalanced == []
    return reader


@pytest.fixture(scope="module")
def html() -> str:
    table = scores(2000)
    return page(contents(limited(table))).html


def test_tables_charts_and_pictures_are_described(html: str) -> None:
    reader = read(html)
    tables = reader.all("table")
    assert len(tables) > 20
    for tag in ("caption", "thead", "tbody"):
        assert len(reader.all(tag)) == len(tables)
    assert all("scope" in head for head in reader.all("th"))
    drawings = [one for one in reader.all("svg") if one.get("aria-hidden") != "true"]
    assert all(one["aria-label"] and one["role"] for one in drawings)
    pictures = [one["aria-label"] for one in drawings if one["role"] == "img"]
    assert len(pictures) == len(set(pictures)) >= 2 * 6 * len(METHODS)
    assert all(one["alt"] for one in reader.all("img"))
    assert reader.all("html") == [{"lang": "en"}]
    levels = [tag for tag, _, _ in reader.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == "h1"
    assert levels.count("h1") == 1


def test_nothing_is_fetched(html: str) -> None:
    reader = read(html)
    for name, attributes, _ in reader.elements:
        for key in ("src", "href", "xlink:href", "srcset", "poster", "action"):
            assert attributes.get(key, "#").startswith(("#", "data:")), (name, attributes)
    assert "@import" not in html
    assert not re.search(r"url\((?!data:)", html)
    assert "default-src 'none'" in html


def test_one_block_is_shown_for_each_part_and_the_others_are_hidden(html: str) -> None:
    reader = read(html)
    blocks = [one for tag in ("p", "figure", "div") for one in reader.all(tag)]
    shown = [one for one in blocks if one.get("data-view") == "0"]
    hidden = [one for one in blocks if one.get("data-view") == "1"]
    # Summary, chart, scores, maps, uncertainty, outcomes.
    assert len(shown) == len(hidden) == 6
    assert not any("hidden" in one for one in shown)
    assert all("hidden" in one for one in hidden)
    assert len(reader.all("option")) == 2 * len(METHODS) + 21
    assert "all frames (2000)" in html


def test_dots_are_thinned_and_lines_are_not(html: str) -> None:
    for chart in re.findall(r"<figure><figcaption>.*?</figure>", html, re.DOTALL):
        assert chart.count("data-in=") <= MAX_DOTS
    dots = html.count("<circle") - html.count('class="halo"') - html.count('class="estimate"')
    assert dots > 20 * MAX_DOTS
    # A median and a band for every method, figure and stratum that has frames.
    assert html.count('class="band') > 15 * 5 * len(METHODS)


def test_optional_parts_are_shown_where_there_are_data(html: str, tmp_path: Path) -> None:
    for absent in ('id="budget"', 'id="changes"', 'id="factors"', 'id="rigs"'):
        assert absent not in html
    cause = {"bias_pct_L": 0.01, "rmse_pct_L": 0.02, "low": 0.01, "high": 0.03}
    file = tmp_path / "budget.json"
    file.write_text(json.dumps({"exact_fit": {"calibration": cause, "noise": cause}}))
    table = scores(60, ("exact_fit", "mine"))
    full = page(contents(table, budget=read_budget(file))).html
    read(full)
    assert full.count('class="share" style="width: 100.0%"') == 2
    assert read_budget(tmp_path / "none.json") == {}
    for wrong, message in (
        ({"noise": {"low": 1}}, r"the key exact_fit\.noise\.bias_pct_L is missing"),
        ({"noise": cause | {"low": 10**400}}, r"exact_fit\.noise\.low is 1000"),
        ({"noise": cause | {"low": "x" * 9000}}, r"exact_fit\.noise\.low is 'xxx"),
        ({"x" * 9000: 1}, r"exact_fit\.xxx"),
    ):
        file.write_text(json.dumps({"exact_fit": wrong}))
        with pytest.raises(InputError, match=message) as refusal:
            read_budget(file)
        assert len(str(refusal.value)) < 1000


def test_what_changed_since_a_baseline_is_shown_with_its_history(tmp_path: Path) -> None:
    run, path = Drawn(0).run(), tmp_path / "drawn.json"
    write_baseline(changed(run, "force_error_pct", 2.0, pl.col("method") == "first"), path)
    write_baseline(run, path, "the fit starts <nearer>")
    now = changed(run, "x_c_error_pct_L", 1.1, pl.col("method") == "second")
    kept = read_baseline(path)
    paired = PairedScene("drawn", pair(kept.run, now, path), True, True, False)
    comparison = table({"drawn": paired}, ["drawn: 3 of 270 frames have no partner"])
    assert comparison.worse
    changes = changes_of("drawn", comparison, versions(kept))
    html = page(contents(scores(60, ("exact_fit", "mine")), changes=changes)).html
    read(html)
    section = html.partition('<section id="changes">')[2].partition("</section>")[0]
    assert f"compared: {len(comparison.worse)} worse, 0 better, 0 not distinguishable" in section
    short_table, _, rest = section.partition("<details>")
    assert re.findall(r'<th scope="row">(\w+)</th>', short_table) == (
        ["second"] * len(comparison.worse)
    )
    assert short_table.count(">worse<") == len(comparison.worse)
    everything, history = rest.split("History of the baseline")
    assert everything.count("<tr><th") == 1 + len(comparison.changes)
    assert "Version 2: the fit starts &lt;nearer&gt;" in history
    last = history.partition("Version 2")[2]
    assert re.findall(r'<th scope="row">(.*?)</th><td class="words">(.*?)</td>', last) == [
        ("first", "force error, %")
    ]


@pytest.mark.thorough
def test_without_limits_errors_are_in_per_cent(html: str) -> None:
    plain = page(contents(scores(200))).html
    assert "information limit" in html
    assert "information used, %" in html
    assert "information limit" not in plain
    assert "information used, %" not in plain
    assert "RMSE of x_c in % of L" in plain


def test_names_and_messages_are_no_markup() -> None:
    name = "<script>alert(1)</script>"
    text = page(contents(scores(60, (name, "exact_fit")))).html
    assert name not in text
    assert "&lt;script&gt;alert(1)" in text


def test_a_dataset_without_any_contact_has_a_report() -> None:
    free = scores(600, ("exact_fit", "mine"))
    free = free.filter("free")
    text = page(contents(free)).html
    read(text)
    assert "<td>0 of 60</td>" in text
