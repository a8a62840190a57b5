"""The page in a browser without a screen: what is drawn, filtered, fetched and too wide."""

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.vbaa_bench.report.synthetic import contents, limited, scores
from vbaa_bench.report.page import page

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed"),
]

# Runs in the page; its findings go to the frame around it.
_PROBE = """
<script>
const found = {};
const box = (svg) => svg.getBoundingClientRect();
const drawn = (svg) => box(svg).width > 40 && box(svg).height > 10;
const charts = () => all("svg:not(.key)").filter((svg) => svg.checkVisibility());
const key = (name) => viewer.dispatchEvent(new KeyboardEvent("keydown", { key: name }));
found.width = innerWidth;
found.overflow = document.documentElement.scrollWidth - innerWidth;
found.height = document.documentElement.scrollHeight;
found.chart_bottom = box(charts()[0]).bottom;
found.picture_top = one(".rig").getBoundingClientRect().top;
const shownMethods = (selector) =>
  new Set(all(selector).filter((one) => one.checkVisibility()).map((one) => one.dataset.of)).size;
found.methods = [shownMethods(".map"), shownMethods("figure[data-of]")];
found.charts = charts().length;
found.undrawn = charts().filter((svg) => !drawn(svg)).length;
const scores = () => all("#scores table").find((table) => table.checkVisibility()).textContent;
found.scores = scores();
one("#view").value = "2";
one("#view").dispatchEvent(new Event("change"));
const shown = all("[data-view]").filter((block) => !block.hidden && !block.hasAttribute("hidden"));
found.views = [...new Set(shown.map((block) => block.dataset.view))];
found.filtered = scores();
const dots = all("circle[data-in]");
found.dots_hidden = dots.filter((dot) => !dot.checkVisibility()).length;
found.dots_wrong = dots.filter((dot) => dot.hasAttribute("hidden") === within(dot)).length;
one("#view").value = "0";
one("#view").dispatchEvent(new Event("change"));
const worst = () => all(".worst").filter((frame) => frame.checkVisibility());
found.first = worst().map((frame) => frame.textContent.trim());
key("ArrowRight");
found.second = worst().map((frame) => frame.textContent.trim());
const marks = () => getComputedStyle(one(".overlay", worst()[0])).display;
found.marks = marks();
key("o");
found.marks_off = marks();
key("ArrowDown");
found.method = pick.value;
dots[0].dispatchEvent(new PointerEvent("pointerover", { bubbles: true, clientX: 50 }));
found.tip = tip.checkVisibility() && tip.textContent;
found.fetched = performance.getEntriesByType("resource").map((entry) => entry.name);
parent.postMessage(found, "*");
</script>
"""
_FRAMES = """
<body style="margin: 0"><iframe src="page.html" style="width: 390px; height: 844px"></iframe>
<iframe src="page.html" style="width: 1400px; height: 900px; border: 0"></iframe>
<pre id="found"></pre><script>
const found = [];
addEventListener("message", (event) => {
  found.push(event.data);
  document.getElementById("found").textContent = JSON.stringify(found);
});
</script></body>
"""


_SWITCHES = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--enable-logging=stderr",
    "--window-size=1500,1800",
    "--virtual-time-budget=20000",
    "--dump-dom",
)


def browse(html: str, folder: Path, probe: str = _PROBE) -> tuple[list[dict[str, Any]], str]:
    """Open the page 390 and 1400 px wide; return findings by width, and the browser's console."""
    (folder / "page.html").write_text(html.replace("</body>", f"{probe}</body>"), encoding="utf-8")
    (folder / "frames.html").write_text(_FRAMES, encoding="utf-8")
    assert BROWSER is not None
    done = subprocess.run(
        [BROWSER, *_SWITCHES, f"--user-data-dir={folder / 'user'}", f"file://{folder}/frames.html"],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    text = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert text, done.stdout[-2000:]
    content = text[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
    found = sorted(json.loads(content or "[]"), key=lambda one: float(one["width"]))
    return found, "\n".join(line for line in done.stderr.splitlines() if ":CONSOLE" in line)


@pytest.fixture(scope="module")
def big() -> str:
    table = scores(10_000)
    return page(contents(limited(table))).html


def test_ten_thousand_frames_are_less_than_eight_megabytes(big: str) -> None:
    assert 1e6 < len(big.encode()) < 8e6


def test_the_page_works_narrow_and_wide(big: str, tmp_path: Path) -> None:
    found, console = browse(big, tmp_path)
    assert console == ""
    assert [one["width"] for one in found] == [390, 1400]
    narrow, wide = found
    for one in found:
        assert one["overflow"] <= 0
        assert one["fetched"] == []
        assert one["charts"] >= 5 + 4
        assert one["undrawn"] == 0
        assert one["views"] == ["2"]
        assert one["filtered"] != one["scores"]
        assert one["dots_hidden"] > 500
        assert one["dots_wrong"] == 0
        assert len(one["first"]) == len(one["second"]) == 1
        assert one["first"] != one["second"]
        assert (one["marks"], one["marks_off"]) == ("inline", "none")
        assert one["method"] == "m1"
        assert "deflection" in one["tip"]
    assert narrow["methods"] == [1, 1]
    assert wide["methods"] == [6, 6]
    # Headline, chart and picture are on the first screen; on a telephone the chart is.
    assert wide["chart_bottom"] < 844
    assert wide["picture_top"] < 300
    assert narrow["chart_bottom"] < 844
    assert wide["height"] < 6000


def test_a_fault_of_a_page_is_noticed(tmp_path: Path) -> None:
    html = page(contents(scores(60, ("exact_fit",)))).html
    wide = '<div style="width: 2000px">wide</div><img src="http://127.0.0.1:9/x.png" alt="">'
    found, console = browse(html.replace("</main>", f"{wide}</main>"), tmp_path)
    assert all(one["overflow"] > 0 for one in found)
    assert "Content Security Policy" in console
