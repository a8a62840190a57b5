"""The page of all keys of a scene is that of the code, and complete."""

import re
from pathlib import Path

from vbaa_bench.report.scene_keys import page
from vbaa_bench.scene.json_schema import scene_schema

PAGE = Path(__file__).parents[3] / "docs" / "scene_keys.md"


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), (
        "run vbaa-bench schema scene > docs/scene_keys.md"
    )


def test_the_page_has_every_section_and_key() -> None:
    schema = scene_schema()
    sections = [schema, *schema["$defs"].values()]
    text = page()
    rows = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    used = [one for one in sections if one.get("description", "").splitlines()[0] in text]
    keys = [
        key
        for one in used
        for key, value in one["properties"].items()
        if not (key == "kind" and "const" in value)
    ]
    assert sorted(rows) == sorted(keys)
    assert len(rows) > 300


def test_every_link_leads_to_a_heading() -> None:
    text = page()
    headings = re.findall(r"^## (.*)$", text, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}
    links = set(re.findall(r"\]\(#([^)]*)\)", text))
    assert links
    assert links <= anchors
