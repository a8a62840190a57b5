from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from results.learned_beam import comparison as module
from results.learned_beam.comparison import count_datasets, measure
from results.learned_beam.table import HEADS, Errors, markdown
from solver.instrument.errors import InputError
from solver.instrument.observation import Observations, open_observations


def test_a_line_counts_answers_and_those_within_three_sigmas() -> None:
    rows = np.array(
        [[0.1, 0.05, 1.0, 0.2, 0.02, 3e-5, 4.0], [-0.1, 0.02, 1.0, 0.5, np.nan, 4e-5, 1.0]]
    )
    line = dict(zip(HEADS, Errors("a", "learned", 4, rows).line(), strict=True))
    assert line["contact in Sigma_o, RMSE mm"] == f"{np.sqrt((0.03**2 + 0.04**2) / 2):.3f}"
    assert line["this within 3 sigma, %"] == "50"
    assert line["answered, %"] == "50"
    assert line["RMSE of x_c, % of L"] == "0.100"
    assert line["within 3 sigma, %"] == "50"
    assert line["sigma / RMSE"] == f"{np.sqrt((0.05**2 + 0.02**2) / 2) / 0.1:.2f}"
    assert line["RMSE of force, %"] == "1.00"
    assert line["force within 3 sigma, %"] == "50"
    assert line["limit, % of L"] == "0.020"
    assert line["sigma / limit, median"] == "2.50"
    assert line["error / limit, median"] == "5.00"
    record = Errors("a", "learned", 4, rows).record()
    assert record["frames"] == 4
    assert record["answered, %"] == 50
    assert record["limit, % of L"] == pytest.approx(0.02)
    nothing = Errors("a", "learned", 4, np.empty((0, 7)))
    assert nothing.record()["median"] is None
    empty = nothing.line()
    assert empty[:4] == ("a", "learned", "4", "0")
    assert len(empty) == len(HEADS)
    assert "| a | learned | 4 |" in markdown([Errors("a", "learned", 4, rows)], "command")


def test_the_beam_is_learned_from_other_pushes_than_it_is_tested_on(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(root: Path) -> Observations:
        """Return the four frames as pushes of one frame each."""
        observations = open_observations(root)
        frames = tuple(replace(frame, push_id="") for frame in observations.frames)
        return replace(observations, frames=frames)

    monkeypatch.setattr(module, "open_observations", opened)
    assert count_datasets([dataset]) == 1
    stated, learned = measure([dataset], pushes=2, draws=2, seed=3, force_sigma_pct=0.1)
    assert (stated.beam, learned.beam) == ("as stated", "learned")
    assert 0 < len(learned.rows) <= learned.frames == stated.frames
    assert np.abs(learned.rows[:, 0]).max() < 1


def test_weights_need_the_sigma_of_the_known_force(dataset: Path) -> None:
    with pytest.raises(InputError, match="needed is the sigma of the known force"):
        measure([dataset], pushes=2, draws=1, seed=3, weights=dataset)


def test_a_rig_whose_images_show_no_beam_answers_no_frame(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_observations: Observations) -> None:
        raise InputError("the rest images show no beam")

    monkeypatch.setattr(module, "set_up", fail)
    stated, learned = measure([dataset], pushes=1, draws=1, seed=3)
    assert stated.frames == learned.frames == 4
    assert len(stated.rows) == len(learned.rows) == 0


def test_a_dataset_without_pushes_to_test_on_is_refused(dataset: Path) -> None:
    with pytest.raises(InputError, match="no beam can be learned from 100 pushes"):
        measure([dataset], pushes=100, draws=1, seed=3)


def test_weights_on_another_beam_are_refused(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Path] = []

    def opened(root: Path) -> Observations:
        """The weights are opened first; the beam of the second dataset is longer."""
        observations, rig = open_observations(root), open_observations(root).rig
        calls.append(root)
        if len(calls) == 1:
            return observations
        longer = replace(rig, beam=replace(rig.beam, length=0.3))
        return replace(observations, rig=longer)

    monkeypatch.setattr(module, "open_observations", opened)
    with pytest.raises(InputError, match="needed is a weight on the same beam"):
        measure([dataset], pushes=2, draws=1, seed=3, force_sigma_pct=0.1, weights=dataset)
