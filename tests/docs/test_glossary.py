"""The glossary has what estimates contain, and the terms that pages introduce."""

import re
from pathlib import Path
from typing import Final

from solver.instrument.quantities import QUANTITIES

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GLOSSARY = (DOCS / "glossary.md").read_text(encoding="utf-8")
TERMS = [row.lower() for row in re.findall(r"^\| (.*?) \|", GLOSSARY, re.MULTILINE)]
# Words in italics for their weight in a sentence, not as terms.
STRESSED: Final = {"bent", "if", "null", "rise", "rejected", "state"}


def test_every_quantity_of_an_estimate_is_defined() -> None:
    # Of a vector, one component stands for all.
    families = {re.sub("_[xyz]_", "_._", column.name) for column in QUANTITIES.values()}
    missing = [name for name in families if not re.search(f"`{name}`", GLOSSARY)]
    assert missing == []


def test_every_term_in_italics_is_defined() -> None:
    missing = []
    for page in (ROOT / "README.md", ROOT / "solver" / "README.md", *sorted(DOCS.glob("*.md"))):
        text = page.read_text(encoding="utf-8")
        for term in re.findall(r"(?<![*\w])\*([A-Za-z][^*\n.]*)\*(?!\*)", text):
            defined = any(term.lower() in one for one in TERMS) or f"*{term}*" in GLOSSARY
            if not defined and term not in STRESSED:
                missing.append(f"{page.name}: {term}")
    assert missing == []
