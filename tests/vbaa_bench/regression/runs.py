"""Scored runs made of drawn errors: pushes of three steps, heavy tails, shared by the methods."""

from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from tests.draws import generator
from vbaa_bench.regression.compared import COMPARED, TIME
from vbaa_bench.regression.scored_run import ScoredRun

METHODS = ("first", "second")
SCENE = {"camera": {"width_px": 512}}
STEPS = (5, 10, 20)
DISTANCES = (60, 80, 100, 120, 140, 160, 180, 200, 220)
# As in the runs of results/regression/README.md: the sigma of the errors that all frames of a
# dataset share, over that of the frames.
SHARED = 0.2


@dataclass(frozen=True)
class Drawn:
    """Errors of a run: its images are those of `noise`; `repeats` sets the number of pushes."""

    noise: int
    repeats: int = 10

    def run(self) -> ScoredRun:
        """The errors of all methods in all frames.

        Each trial has an error of its own, the same in all runs; each frame has noise that the
        methods share in part, with the tails of Student's t with 3 degrees of freedom; and the
        calibration adds an error to all frames.
        """
        trials = self.repeats * len(DISTANCES) * len(STEPS)
        systematic = generator(__name__, 1).standard_t(3, size=(trials, len(METHODS)))
        rng = generator(__name__, 2, self.noise)
        common = rng.standard_t(3, size=(trials, 1))
        own = rng.standard_t(3, size=(trials, len(METHODS)))
        calibration = SHARED * rng.standard_normal(len(METHODS))
        errors = 0.01 * (systematic + common + own + calibration)
        learned = np.exp(0.25 * rng.standard_normal())  # from the images at rest
        times = 2.0 * np.exp(0.02 * rng.standard_normal(len(METHODS)))
        parts = [
            self._rows(name, errors[:, n], 0.02 * learned, times[n] * _jitter(rng, trials))
            for n, name in enumerate(METHODS)
        ]
        return ScoredRun("Drawn", SCENE, f"images of {self.noise}", "processor", pl.concat(parts))

    def _rows(self, method: str, error: np.ndarray, sigma: float, time: np.ndarray) -> pl.DataFrame:
        trial = np.arange(len(error))
        push = trial // len(STEPS)
        distance = np.array(DISTANCES, float)[push % len(DISTANCES)]
        columns = {
            "rig": 0,
            "trial": trial,
            "push_id": [f"push {number} of {self.noise}" for number in push],
            "push": [f"{STEPS[n % len(STEPS)]} %" for n in trial],
            "hidden_by": None,
            "hidden_place": None,
            "contact_distance_at_rest_mm": distance,
            "normal_deg": 0.0,
            "k_s_n_m": None,
            "availability_asked": None,
            "true_x_c_mm": distance - 0.3,
            "method": method,
            "outcome": "contact",
            **dict.fromkeys(quantity.column for quantity in COMPARED),
            "x_c_error_pct_L": error,
            "force_error_pct": 5 * error,
            "x_c_sigma_pct_L": sigma,
            "answered_pct": 100.0,
            "consistent_pct": np.where(np.abs(error) < 3 * sigma, 100.0, 0.0),
            TIME.column: time,
        }
        texts = ("hidden_by", "hidden_place")
        numbers = ("k_s_n_m", "availability_asked", *(quantity.column for quantity in COMPARED))
        types = dict.fromkeys(texts, pl.String()) | dict.fromkeys(numbers, pl.Float64())
        return pl.DataFrame(columns, schema_overrides=types)


def _jitter(rng: np.random.Generator, count: int) -> np.ndarray:
    """Scatter of times, with a frame in fifty interrupted for as long as it takes itself."""
    interrupted = rng.random(count) < 0.02
    return np.asarray(np.exp(0.05 * rng.standard_normal(count)) * (1 + interrupted))


def changed(run: ScoredRun, column: str, factor: float, where: pl.Expr) -> ScoredRun:
    """The run with some values of a column multiplied."""
    value = pl.when(where).then(pl.col(column) * factor).otherwise(pl.col(column))
    return replace(run, frames=run.frames.with_columns(value.alias(column)))
