"""This version answers as the frozen one did, and what would differ is seen."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.frozen import answers, measurements
from tests.frozen.__main__ import DATA
from tests.frozen.answers import Answer
from tests.frozen.compared import SHARE_ON_ANY, Truth, compared, passes, truths_of


@pytest.mark.thorough
def test_this_version_answers_as_the_frozen_one() -> None:
    frames = measurements.load(DATA)
    results = compared(
        answers.load(DATA / "answers.npz"), dict(answers.answers(frames)), truths_of(frames)
    )
    differ = [difference for result in results for difference in result.differ]
    assert passes(results, SHARE_ON_ANY), "\n".join(f"{one.question}: {one.how}" for one in differ)


@pytest.fixture
def frozen() -> dict[str, Answer]:
    values, sigmas = np.array([0.12, 0.05]), np.array([1e-4, 1e-3])
    one = Answer("contact", ("x_c_m", "force_n"), values, sigmas, np.array([[1, 0.5], [0.5, 1]]))
    return {f"exact_fit rig {i}": one for i in range(10)}


@pytest.mark.parametrize(
    "change",
    [
        {"outcome": "invalid"},
        {"names": ("x_c_m", "f_n")},
        {"values": np.array([0.12, 0.05 + 2e-5])},
        {"sigmas": np.array([1e-4, 1.02e-3])},
        {"correlation": np.array([[1, 0.52], [0.52, 1]])},
    ],
)
def test_a_change_is_seen(frozen: dict[str, Answer], change: dict[str, Any]) -> None:
    assert passes(compared(frozen, dict(frozen), {}))
    now = frozen | {"exact_fit rig 3": frozen["exact_fit rig 3"]._replace(**change)}
    (result,) = compared(frozen, now, {})
    assert [one.question for one in result.differ] == ["exact_fit rig 3"]
    assert not passes([result])


def test_an_answer_that_is_missing_is_seen(frozen: dict[str, Answer]) -> None:
    now = {question: frozen[question] for question in list(frozen)[1:]}
    for old, new in ((frozen, now), (now, frozen)):
        (result,) = compared(old, new, {})
        assert [one.question for one in result.differ] == ["exact_fit rig 0"]


def test_larger_errors_are_seen_though_values_move_little(frozen: dict[str, Answer]) -> None:
    truths = {question.partition(" ")[2]: Truth(0.12 + 1e-6, 0.24) for question in frozen}
    now = {
        question: one._replace(values=one.values - [9e-7, 0]) for question, one in frozen.items()
    }
    (result,) = compared(frozen, now, truths)
    assert not result.differ
    assert not passes([result])


def test_measurements_are_stored_and_read(tmp_path: Path) -> None:
    frames = measurements.load(DATA)
    assert len({frame.dataset for frame in frames}) > 100
    assert all(frames[i].push == frame.push for frame in frames for i in frame.earlier)
    rigs = json.loads((DATA / "frames.json").read_text("utf-8"))["rigs"]
    measurements.save(tmp_path, frames, {name: json.dumps(rig) for name, rig in rigs.items()})
    for frame, again in zip(frames, measurements.load(tmp_path), strict=True):
        assert frame[:4] == again[:4]
        one, other = frame.measurement, again.measurement
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.view.shared_errors, other.view.shared_errors)
        np.testing.assert_array_equal(one.base_covariance, other.base_covariance)
