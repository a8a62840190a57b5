"""The page for entrants and its example say what the code does."""

import importlib.util
import io
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import polars as pl
import pytest

from solver.instrument.estimate import Outcome
from tests.simulated import columns, measurement, pushed_points
from vbaa_bench.scoring.information_sets import SETS
from vbaa_bench.scoring.predictions import checked_predictions, unknown_columns
from vbaa_bench.scoring.scored_quantities import NUMBERS
from vbaa_bench.suite.submission import check_submission, read_submission

# Error of a point [m]: a third of that on the paper's rig, so that the models' own errors show.
SIGMA = 1e-6
DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "entrants.md").read_text(encoding="utf-8")


def test_the_example_of_a_predictions_file_is_read() -> None:
    (text,) = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    raw = pl.read_csv(io.StringIO(text), infer_schema=False)
    table = checked_predictions(raw, "the page")
    assert list(unknown_columns(raw.columns, "the page")) == []
    assert table["outcome"].to_list() == ["contact", "no contact", "not identifiable"]
    assert table["x_c_sigma_mm"].to_list() == [0.05, None, None]


def test_the_columns_outcomes_and_information_sets_of_the_page_exist() -> None:
    rows = re.findall(r"^\| (`.*?) \|", PAGE.partition("**Outcomes.**")[0], re.MULTILINE)
    names = [name for row in rows for name in re.findall(r"`([^`<>]+)`", row)]
    assert len(names) > 10
    texts = {"frame_id", "outcome", "message", "assumption", "information"}
    assert set(names) <= {*NUMBERS, *texts}
    outcomes = PAGE.partition("**Outcomes.**")[2].partition("**Failures**")[0]
    assert set(re.findall(r'"([^"]+)"', outcomes)) == {str(outcome) for outcome in Outcome}
    information = PAGE.partition("**Information.**")[2].partition("A column states")[0]
    assert set(re.findall(r'"([^"]+)"', information)) == set(SETS)


def test_every_folder_of_an_entrant_can_be_sent() -> None:
    folders = sorted((DOCS / "entrants").glob("[!_]*"))
    assert [check_submission(folder) for folder in folders] == [[] for _ in folders]
    assert [read_submission(folder).name for folder in folders] == [one.name for one in folders]
    # The page names each.
    assert all(f"(entrants/{one.name}/{one.name}.py)" in PAGE for one in folders)


def _entrant(name: str) -> ModuleType:
    path = DOCS / "entrants" / name / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


ENTRANTS = [_entrant("spline_curvature"), _entrant("consistent_sections")]


# Errors of a linear theory in the force would be 10 % at the larger deflection. Noise is a tenth of
# the usual: derivatives of a spline amplify it, and their errors have heavy tails.
@pytest.mark.thorough
@pytest.mark.parametrize("contact", [0.08, 0.12, 0.18])
@pytest.mark.parametrize("deflection", [0.1, 0.2])
@pytest.mark.parametrize("entrant", ENTRANTS)
def test_contact_and_force_of_a_pushed_beam(
    entrant: ModuleType, contact: float, deflection: float, random: np.random.Generator
) -> None:
    points, x_c, force = pushed_points(contact, deflection)
    errors = []
    for _ in range(15):
        noise = random.normal(0, SIGMA / 10, len(points))
        estimate = entrant.estimate(measurement(points + np.outer(noise, [0, 1]), SIGMA / 10))
        errors.append([estimate.x_c_mm - 1e3 * x_c, estimate.force_n / force - 1])
    # One in 30 is beyond these limits at most, so that 8 of 15 are in less than one of 1e7 runs.
    x_c_error, force_error = np.median(np.abs(errors), axis=0)
    assert x_c_error < 0.01 * 240
    assert force_error < 0.05


@pytest.mark.parametrize("entrant", ENTRANTS)
def test_a_straight_beam_has_no_contact(entrant: ModuleType, random: np.random.Generator) -> None:
    rest = np.column_stack([np.zeros(500), np.linspace(0, 0.24, 500), np.zeros((500, 2))])
    points = columns(rest)
    points[:, 1] += random.normal(0, SIGMA, len(points))
    assert entrant.estimate(measurement(points, SIGMA)).outcome is Outcome.NO_CONTACT
    few = measurement(points[:10], SIGMA)
    assert entrant.estimate(few).outcome is Outcome.NOT_IDENTIFIABLE
