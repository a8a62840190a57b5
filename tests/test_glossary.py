"""The pages name files that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "docs" / "glossary.md", ROOT / "README.md"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_named_on_a_page_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    paths = set(re.findall(r"`((?:solver|vbaa_bench|scenes|tests|results|docs)/[\w./-]+)`", text))
    assert len(paths) > 5
    assert sorted(path for path in paths if not (ROOT / path).exists()) == []
