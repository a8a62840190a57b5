"""The workflows of continuous integration, which were never run, call commands that exist."""

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yaml"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_calls_the_makefile_and_pins_its_actions(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# Never run")
    jobs = YAML(typ="safe").load(text)["jobs"]
    steps = [step for job in jobs.values() for step in job["steps"]]
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.M))
    called = {name for step in steps for name in re.findall(r"make (\w+)", step.get("run", ""))}
    assert called <= targets
    assert {"test", "ci"} <= called
    used = [step["uses"] for step in steps if "uses" in step]
    assert used
    assert all(re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", one) for one in used)
    # The version of each pin, beside it.
    assert len(re.findall(r"@[0-9a-f]{40}  # v[\d.]+$", text, re.M)) == len(used)


def test_the_citations_agree() -> None:
    cff = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    page = (ROOT / "docs/citing.md").read_text(encoding="utf-8")
    assert cff["title"] == "VBAA-Bench" + page.split("{VBAA-Bench}")[1].split("},")[0]
    assert f"version = {{{cff['version']}}}" in page
    (paper,) = cff["references"]
    assert f"title   = {{{paper['title']}}}" in page
    assert f"journal = {{{paper['journal']}}}" in page
