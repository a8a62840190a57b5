"""The page on the format is that of the code, and names every version."""

from pathlib import Path

from vbaa_bench.dataset.exr import CHANNELS
from vbaa_bench.dataset.format_version import SCHEMA
from vbaa_bench.report.format_page import page

PAGE = Path(__file__).parents[3] / "docs" / "format.md"


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), (
        "run vbaa-bench schema format > docs/format.md"
    )


def test_the_page_names_versions_and_layers() -> None:
    text = page()
    assert f"The current version is {SCHEMA}." in text
    assert all(f"| `{layer}` |" in text for layer in CHANNELS)
    assert text.count("\n| 1 | 2 |") == 1
