import sys
from pathlib import Path

import numpy as np
import pytest

from results.learned import regressor as learned
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from tests.draws import generator
from vbaa_bench.scoring.predictions import read_predictions


def beam(contact: float, deflection: float, ground: float = 20.0, peak: float = 150.0) -> Grey:
    """Draw a line that bends up to `contact` and is straight beyond, 1.6 px wide."""
    x = np.linspace(0, 1, 256)
    bent = np.where(x < contact, 3 * x**2 / contact - x**3 / contact**2, 3 * x - contact)
    rows = 20 + 60 * deflection * bent / (3 - contact)
    distance = np.arange(120)[:, None] - rows
    return np.asarray(np.round(ground + peak * np.exp(-(distance**2) / 0.9)), np.uint8)


def drawn(count: int, seed: int) -> tuple[Floats, Floats]:
    values = generator(__name__, seed).uniform([0.2, 0.5], [0.9, 1], (count, 2))
    return np.array([learned.features(beam(*row)) for row in values]), values


def test_features_locate_the_line_and_depend_on_no_brightness() -> None:
    plain = learned.features(beam(0.5, 0.8))
    assert plain == pytest.approx(learned.features(beam(0.5, 0.8, ground=90)), abs=1e-9)
    # Rounding to gray values changes the brightness of the line's flanks.
    assert plain == pytest.approx(learned.features(beam(0.5, 0.8, peak=75)), abs=2e-3)
    blocks = plain.reshape(120 // learned.BLOCK_PX[1], 256 // learned.BLOCK_PX[0])
    assert blocks.sum(axis=0) == pytest.approx(1)
    # At the end, at x = 1, the line is 48 px above its start.
    rows = (np.arange(len(blocks)) + 0.5) * learned.BLOCK_PX[1] - 0.5
    assert rows @ blocks[:, -1] - rows @ blocks[:, 0] == pytest.approx(48, abs=4)
    assert (learned.features(np.full((120, 256), 7, np.uint8)) == 0).all()


def test_a_model_estimates_what_it_was_not_trained_on() -> None:
    pytest.importorskip("sklearn")
    inputs, labels = drawn(60, 1)
    pushes = np.arange(60)
    tried, true = drawn(30, 2)
    estimates = learned.trained(inputs, labels, pushes)(tried)
    rmse = np.sqrt(((estimates - true) ** 2).mean(axis=0))
    assert (rmse < 0.2 * true.std(axis=0)).all()
    assert (learned.trained(inputs, labels, pushes)(tried) == estimates).all()
    # Labels that belong to other images cannot be learned.
    shuffled = learned.trained(inputs, np.roll(labels, 1, axis=0), pushes)(tried)
    assert (np.sqrt(((shuffled - true) ** 2).mean(axis=0)) > 0.7 * true.std(axis=0)).all()


def test_a_small_dataset_cannot_train(dataset: Path) -> None:
    pytest.importorskip("sklearn")
    with pytest.raises(InputError, match="has 2 pushes with contact, allowed are 40 or more"):
        learned.measure(dataset, [dataset])


def test_labels_are_those_of_the_truth(dataset: Path) -> None:
    frames = learned.read(dataset)
    assert sorted(np.round(frames.labels[:, 0], 1)) == [0.4, 0.4, 0.8, 0.8]
    assert frames.image_px == (512, 176)
    assert frames.estimates == {}


def test_a_model_is_an_entrant(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "observations").symlink_to(dataset / "observations")
    frames = list(open_observations(dataset / "observations"))
    models = [lambda tried, x=x: np.tile([x, np.log(0.2)], (len(tried), 1)) for x in (0.4, 0.6)]
    path = learned.write_predictions(tmp_path, models, {frames[0].push_id: 1})
    table = read_predictions(path)
    x_c = dict(table.select("frame_id", "x_c_mm").iter_rows())
    assert set(x_c) == {frame.frame_id for frame in frames}
    for frame in frames:  # a held-out push, and the mean of all models
        expected = 0.6 if frame.push_id == frames[0].push_id else 0.5
        assert x_c[frame.frame_id] == pytest.approx(240 * expected)
    assert table["force_n"].to_numpy() == pytest.approx(0.2)
    assert table["image_ms"].null_count() == 0


def test_an_absent_library_is_one_sentence(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(InputError, match=r"scikit-learn is missing; .*\[learned\]"):
        learned.measure(dataset, [dataset])
