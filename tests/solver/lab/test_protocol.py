"""A set of real images with known loads: what is missing is said, and estimates are scored."""

import io
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from solver.__main__ import main
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.images import png_bytes
from solver.instrument.observation import Observations
from solver.instrument.rig import Gravity, Rig
from solver.instrument.rig_json import rig_to_json
from solver.lab.protocol import KNOWN, MIN_LOADS, KnownLoad, check_protocol
from solver.lab.protocol_report import ProtocolReport
from solver.lab.protocol_score import (
    CONSISTENT,
    GRAVITY,
    GRAVITY_SIGMA,
    Comparison,
    Score,
    compare,
    mistakes,
    scores,
)
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from tests.command_line import CommandLine
from tests.hung import UNIT, hung
from tests.real_set import DOWN, write_complete_set


@pytest.fixture(scope="module")
def whole(observations: Observations, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_complete_set(observations, tmp_path_factory.mktemp("whole") / "set")


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    return shutil.copytree(whole, tmp_path / "set")


def named(folder: Path) -> dict[str, str]:
    return {one.name: one.message for one in check_protocol(folder)[1]}


def test_of_a_complete_set_nothing_is_missing(whole: Path) -> None:
    protocol, missing = check_protocol(whole)
    assert missing == []
    assert protocol is not None
    assert len(protocol.known) == 2 * MIN_LOADS
    assert protocol.known[0] == KnownLoad("load_00.png", "weight", 0.08, 5e-4, 4.25e-3, 2e-5)
    assert protocol.known[-1].mass is None


def without(name: str) -> Callable[[Path], object]:
    return lambda folder: shutil.rmtree(folder / name)


def without_one(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).unlink()


def edited(old: str, new: str) -> Callable[[Path], object]:
    """Replace a text in known.csv, once."""

    def edit(folder: Path) -> None:
        text = (folder / KNOWN).read_text(encoding="utf-8")
        assert old in text
        (folder / KNOWN).write_text(text.replace(old, new, 1), encoding="utf-8")

    return edit


def with_rig(change: Callable[[Rig], Rig]) -> Callable[[Path], object]:
    def edit(folder: Path) -> None:
        protocol, _ = check_protocol(folder)
        assert protocol is not None
        text = rig_to_json(change(protocol.observations.rig))
        (folder / "rig.json").write_text(text, encoding="utf-8")

    return edit


def copy_of_an_image(folder: Path) -> None:
    shutil.copy(folder / "images" / "load_00.png", folder / "images" / "load_01.png")


def small_image(folder: Path) -> None:
    (folder / "images" / "load_03.png").write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))


@pytest.mark.parametrize(
    ("spoil", "name", "message"),
    [
        (without("ground"), "too_few", "0 ground/ground_*, needed are 2"),
        (without("ruler"), "too_few", "0 ruler/ruler_*, needed are 1"),
        (without_one("rest/rest_00.png"), "too_few", "1 rest/rest_*, needed are 2"),
        (without_one("calibration/view_03.png"), "too_few", "5 calibration/view_*, needed are 6"),
        (without_one(KNOWN), "unreadable", "known.csv"),
        (without_one("rig.json"), "unreadable", "rig.json"),
        (without_one("images/load_07.png"), "row_wrong", "'load_07.png', allowed is a file in im"),
        (edited("4.25", "4.25 g"), "row_wrong", "known.csv:2: mass_g is '4.25 g'"),
        (
            edited("weight", "wieght"),
            "row_wrong",
            "load is 'wieght', allowed is one of push",
        ),
        (edited("weight", "push"), "too_few", "19 rows of known.csv with load weight, needed"),
        (edited("load_01", "load_00"), "row_twice", "2 rows for load_00.png"),
        (edited("load_01", "load_00"), "no_row", "1 images have no usable row"),
        (
            edited(",120,", ",1200,"),
            "beyond_tip",
            "load_02.png: distance_mm is 1200, allowed",
        ),
        (copy_of_an_image, "image_copied", "load_01.png is a copy of load_00.png"),
        (small_image, "image_differs", "load_03.png has 5 x 4 px of 8 bits"),
        (with_rig(lambda rig: replace(rig, gravity=None)), "no_gravity", "states no gravity"),
        (
            with_rig(lambda rig: replace(rig, gravity=Gravity(-math.pi / 2))),
            "gravity_inconsistent",
            "points away from the side deflects_towards 1",
        ),
    ],
)
def test_what_is_missing_or_wrong_is_named(
    folder: Path, spoil: Callable[[Path], object], name: str, message: str
) -> None:
    spoil(folder)
    assert message in named(folder)[name]


def test_check_needs_a_rig_or_a_set(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = CommandLine(main, capfd)
    assert "either --rig or --protocol" in command.refused("check")
    assert "is not a folder" in command.refused("check", "--protocol", tmp_path / "none")


def test_all_mistakes_are_named_at_once(folder: Path) -> None:
    without("ruler")(folder)
    without("ground")(folder)
    edited("weight", "")(folder)
    copy_of_an_image(folder)
    messages = [one.message for one in check_protocol(folder)[1]]
    parts = ("ground", "ruler", "load is ''", "is a copy of")
    assert all(any(part in message for message in messages) for part in parts)


def test_a_weight_is_compared_with_balance_and_ruler() -> None:
    """Noise-free columns: the differences are those of the table, the sigmas of both sides."""
    exact, contact = hung(0.6, 1.0)
    rig = replace(exact.rig, gravity=DOWN)
    estimate = hung_weight(replace(exact, rig=rig))
    mass = UNIT / GRAVITY
    load = KnownLoad("a.png", "weight", contact.s + 1e-3, 5e-4, 1.01 * mass, 0.001 * mass)
    place, force = compare(load, estimate, rig)
    assert (place.quantity, force.quantity) == ("s_c_mm", "force_n")
    assert place.estimated is not None
    assert force.estimated is not None
    assert place.estimated - place.known == pytest.approx(-1.0, abs=0.01)
    assert place.known_sigma == pytest.approx(0.5)
    assert force.estimated / force.known == pytest.approx(1 / 1.01, rel=1e-4)
    expected = 1.01 * mass * math.hypot(GRAVITY_SIGMA, GRAVITY * 0.001 / 1.01)
    assert force.known_sigma == pytest.approx(expected, rel=1e-6)
    sigma = math.hypot(expected, estimate.sigma("force_y_n"))
    assert force.deviation == pytest.approx((force.estimated - force.known) / sigma, rel=1e-2)
    by_place, by_force = scores([place, force], rig)
    assert by_force.error_pct == pytest.approx(100 * (1 - 1 / 1.01), rel=1e-3)
    assert by_place.error_pct == pytest.approx(100 * 1e-3 / rig.beam.length, rel=0.01)
    assert force.deviation is not None
    assert by_force.rms_deviation == pytest.approx(abs(force.deviation))
    assert (by_force.n_loads, by_force.answered_pct) == (1, 100)
    assert by_place.within_3_sigma_pct == (100 if abs(place.deviation or 0) <= CONSISTENT else 0)


def test_loads_without_estimate_or_sigma_count_in_what_they_have() -> None:
    exact, _ = hung(0.5, 1.5)
    load = KnownLoad("a.png", "push", 0.1, 5e-4, None, 0.0)
    bare = Estimate(Outcome.CONTACT, values={"x_c_m": 0.102, "force_n": 0.05})
    failed = Estimate(Outcome.INVALID, "no")
    comparisons = [compare(load, one, exact.rig)[0] for one in (bare, failed)]
    (score,) = scores(comparisons, exact.rig)
    assert (score.n_loads, score.answered_pct) == (2, 50)
    assert score.error_pct == pytest.approx(100 * 2e-3 / exact.rig.beam.length)
    assert score.known_pct == pytest.approx(100 * 5e-4 / exact.rig.beam.length)
    assert (score.rms_deviation, score.within_3_sigma_pct) == (None, None)
    (none,) = scores(comparisons[1:], exact.rig)
    assert (none.answered_pct, none.error_pct) == (0, None)
    weighed = load._replace(mass=4e-3, mass_sigma=2e-5)
    _, force = compare(weighed, bare, replace(exact.rig, gravity=DOWN))
    # A magnitude alone has no known component along gravity.
    assert force.estimated is None


def test_the_tables_have_heads_with_units_and_a_dash_for_what_is_missing() -> None:
    missing = Comparison("a.png", "push", "x_c_mm", 100.0, 0.5, None, None)
    score = Score("push", "x_c_mm", 1, 0.0, None, 0.2, None, None)
    report = ProtocolReport((), (missing,), (score,))
    stream = io.StringIO()
    Console(file=stream, width=120).print(*report.tables())
    text = stream.getvalue()
    assert "deviation, sigmas" in text
    assert "RMS, sigmas" in text
    assert "None" not in text


def test_a_slip_of_the_decimal_point_is_a_mistake() -> None:
    exact, contact = hung(0.6, 1.0)
    rig = replace(exact.rig, gravity=DOWN)
    estimate = hung_weight(replace(exact, rig=rig))
    mass = UNIT / GRAVITY
    right = KnownLoad("a.png", "weight", contact.s, 5e-4, mass, 0.001 * mass)
    wrong = right._replace(file_name="b.png", mass=10 * mass, mass_sigma=0.01 * mass)
    answers = [(right, estimate), (wrong, estimate)]
    comparisons = [one for answer in answers for one in compare(*answer, rig)]
    (finding,) = mistakes(answers, comparisons)
    assert finding.name == "contradicted"
    assert finding.message.startswith("b.png: force_n is")


def test_a_load_without_an_estimate_is_named() -> None:
    exact, contact = hung(0.5, 1.5)
    estimate = exact_fit(exact)  # no contact has the force of a weight
    load = KnownLoad("a.png", "push", contact.point[0], 5e-4, None, 0.0)
    (comparison,) = compare(load, estimate, exact.rig)
    assert (comparison.estimated, comparison.deviation) == (None, None)
    (finding,) = mistakes([(load, estimate)], [])
    assert finding.message.startswith("a.png: invalid: ")
