"""The pages name files that exist, commands that can be read, and what the code defines."""

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

import polars as pl
import pytest

import solver
import vbaa_bench
from solver.instrument.estimate import Outcome
from solver.methods import METHODS
from solver.tracker import run_method
from tests.command_words import calls
from tests.simulated import measurement, pushed_points

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
# Executed by a test of their own, in a folder with the files that their commands name.
EXECUTED: Final = {"kinds.md"}


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_named_on_a_page_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    paths = set(re.findall(r"`((?:solver|vbaa_bench|scenes|tests|results|docs)/[\w./-]+)`", text))
    assert sorted(path for path in paths if not (ROOT / path).exists()) == []


def test_the_first_page_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150


def test_every_command_of_a_page_can_be_read() -> None:
    mistakes = [
        f"{page.name}: {mistake}"
        for page in (*PAGES, ROOT / "solver" / "README.md", ROOT / "scenes" / "README.md")
        if page.name not in EXECUTED
        for block in blocks(page, "sh")
        for call in calls(block)
        if (mistake := call.mistake())
    ]
    assert mistakes == []


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("vbaa-bench run", "Missing argument"),
        ("vbaa-bench run scenes/quickstart.yaml --frame 3", "No such option"),
        ("vbaa-bench run scenes/quickstart.yaml --frames many", "Invalid value"),
        ("vbaa-bench limit runs/quickstart", "No such command"),
        ("vbaa-bench view scenes/none.yaml", "neither a file nor a shipped scene"),
        ('vbaa-bench view "$SCENE" --frame 3', "No such option"),
        ("python -m solver images/*.png --rigs rig", "No such option"),
    ],
)
def test_a_command_that_does_not_exist_is_found(line: str, message: str) -> None:
    (call,) = calls(line)
    assert message in call.mistake()


def test_functions_of_the_examples_take_these_arguments() -> None:
    packages = {"vb": vbaa_bench, "solver": solver}
    found = 0
    for page in (*PAGES, ROOT / "solver" / "README.md"):
        for block in blocks(page, "python"):
            if block.startswith(" "):  # entries of a dictionary
                continue
            for node in ast.walk(ast.parse(block)):
                if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                    continue
                owner, name = node.func.value, node.func.attr
                if isinstance(owner, ast.Name) and owner.id in packages:
                    function = getattr(packages[owner.id], name)
                    names = {str(keyword.arg): None for keyword in node.keywords}
                    inspect.signature(function).bind(*node.args, **names)
                    found += 1
    assert found >= 5


def test_the_method_of_the_page_answers() -> None:
    (code,) = blocks(DOCS / "your_method.md", "python")
    names: dict[str, object] = {}
    exec(code, names)
    points, _, _ = pushed_points(0.12, 0.1)
    method = names["straight_end"]
    assert callable(method)
    estimate = run_method(method, measurement(points, 1e-6))
    assert estimate.outcome is Outcome.CONTACT
    # Linear theory is a few millimetres off.
    assert estimate.x_c_mm == pytest.approx(120, abs=5)
    straight = run_method(method, measurement(points * [1, 0], 1e-6))
    assert straight.outcome is Outcome.NO_CONTACT


def test_the_table_for_a_paper_is_written(tmp_path: Path) -> None:
    rmse = {"two_point": 3.0, "linear_fit": 0.04, "exact_fit": 0.03, "another": 0.01}
    rows = [
        {
            "method": method,
            "stratum": "deflection_class",
            "value": value,
            "quantity": "x_c_mm",
            "rmse": size,
            "rmse_low": size - 0.015,
            "rmse_high": size + 0.015,
        }
        for method, size in rmse.items()
        for value in ("3 – 7 %", "7 – 15 %")
    ]
    folder = tmp_path / "runs" / "quickstart" / "scores"
    folder.mkdir(parents=True)
    pl.DataFrame(rows).write_csv(folder / "strata.csv")
    code, _ = blocks(DOCS / "paper_table.md", "python")
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert r"RMSE of $x_c$ [mm] & 3 – 7 \% & 7 – 15 \% \\" in done.stdout
    assert r"two\_point & 3 & 3 \\" in done.stdout
    assert r"linear\_fit & \textbf{0.04} & \textbf{0.04} \\" in done.stdout
    assert r"exact\_fit & \textbf{0.03} & \textbf{0.03} \\" in done.stdout


def test_the_page_of_methods_has_all_of_them() -> None:
    text = (DOCS / "methods.md").read_text(encoding="utf-8")
    _, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    by_name = {section.partition("\n")[0]: section for section in sections}
    assert set(METHODS) == by_name.keys() - {"What all methods share"}
    outcomes = {str(outcome) for outcome in Outcome}
    for name in METHODS:
        section = by_name[name]
        absent = [
            one for one in ("**Assumes**", "**Outcomes:**", "**Fails**") if one not in section
        ]
        assert absent == [], name
        quoted = re.findall(r"\"([^\"]+)\"", section.partition("**Outcomes:**")[2].splitlines()[0])
        assert {one.lower() for one in quoted} <= outcomes


def test_the_outcomes_of_the_page_are_those_of_the_code() -> None:
    text = (DOCS / "honesty.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w -]+) \| (yes|no) \| (.*?) \|$", text, re.MULTILINE)
    assert rows == [
        (str(outcome), "yes" if outcome.has_values else "no", outcome.sentence)
        for outcome in Outcome
    ]
