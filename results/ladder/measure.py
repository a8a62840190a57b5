"""Errors of every rung on a dataset, and the table of the ladder."""

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import polars as pl
from scipy.stats import norm

from results.ladder.rungs import LIMIT, rungs_of
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from solver.instrument.units import MILLIMETRE
from solver.tracker import PushTracker
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.derived import read_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.bootstrap import draws, group_numbers, interval

# Deflections of Fig. 8, as the truth names the pushes.
DEFLECTIONS: Final = ("5 %", "10 %", "20 %")
# Quantiles of a normal distribution that stand for the errors of a method that attains the limit.
_QUANTILES: Final = norm.ppf((np.arange(200) + 0.5) / 200)

Row = dict[str, Any]


class Errors(NamedTuple):
    """Errors of one rung in n frames: of x_c [% of L] and of the force [%], NaN if there is none.

    Those of the limit are its standard deviations.
    """

    rung: str
    x_c: Floats
    force: Floats

    @property
    def x_c_median(self) -> float:
        """Median size of the error of x_c [% of L]."""
        errors = self.x_c[np.isfinite(self.x_c)]
        if self.rung == LIMIT:
            errors = np.outer(errors, _QUANTILES)
        return float(np.median(np.abs(errors)))


class Ladder(NamedTuple):
    """Errors of all rungs of a dataset in the same n frames, and each frame's push.

    `pushes` (n,) are the names of `DEFLECTIONS`; `groups` (n,) number the pushes that a bootstrap
    draws together.
    """

    dataset: str
    rungs: Sequence[Errors]
    pushes: npt.NDArray[np.str_]
    groups: npt.NDArray[np.int64]

    def rows(self) -> Iterator[Row]:
        """Write one row per rung: errors, and what the rung divides the one before it by.

        `share_pct` is the rung's share of the whole way, on a logarithmic scale.
        """
        before = _rms(self.rungs[0].x_c)
        whole = math.log(before / _rms(self.rungs[-1].x_c))
        counts = draws(int(self.groups.max()) + 1)
        for errors in self.rungs:
            rmse = _rms(errors.x_c)
            answered = np.isfinite(errors.x_c)
            squares, cases = (
                np.bincount(self.groups[answered], weights, counts.shape[1])
                for weights in (errors.x_c[answered] ** 2, None)
            )
            with np.errstate(invalid="ignore"):  # a draw may have no answered frame
                means = counts @ squares / (counts @ cases)
            low, high = interval(np.sqrt(means)) or (None, None)
            yield {
                "dataset": self.dataset,
                "rung": errors.rung,
                "frames": len(errors.x_c),
                "answered": int(answered.sum()),
                "x_c_median_abs_pct_L": errors.x_c_median,
                **{
                    f"x_c_rmse_pct_L_at_{name.partition(' ')[0]}_pct": _rms(
                        errors.x_c[self.pushes == name]
                    )
                    for name in DEFLECTIONS
                },
                "x_c_rmse_pct_L": rmse,
                "x_c_rmse_low_pct_L": low,
                "x_c_rmse_high_pct_L": high,
                "force_rmse_pct": _rms(errors.force),
                "divides_by": before / rmse,
                "share_pct": 100 * math.log(before / rmse) / whole,
            }
            before = rmse


def measure(root: Path, on_frame: Callable[[], None]) -> Ladder:
    """Estimate every frame of a dataset, or of all rigs of a collection, on every rung.

    `on_frame` is called once per frame. Raises InputError, also without information limits.
    """
    parts, tables = [], []
    for layout in _layouts(root):
        truth = open_truth(layout.truth, centrelines=False).frames
        parts.append(list(_errors(layout, truth, on_frame)))
        tables.append(truth)
    joined = [
        Errors(same[0].rung, *map(np.concatenate, ([e.x_c for e in same], [e.force for e in same])))
        for same in zip(*parts, strict=True)
    ]
    frames = pl.concat(tables, how="diagonal_relaxed")
    return Ladder(root.name, joined, frames["push"].to_numpy(), group_numbers(frames))


def count_frames(roots: Sequence[Path]) -> int:
    """Count the frames of datasets and collections. Raises InputError."""
    layouts = itertools.chain.from_iterable(map(_layouts, roots))
    return sum(len(open_observations(layout.observations).frames) for layout in layouts)


def _layouts(root: Path) -> Collection[Layout]:
    """List the datasets of a collection; a dataset is its only one."""
    return CollectionLayout(root).rigs().values() if is_collection(root) else [Layout(root)]


def _errors(layout: Layout, truth: pl.DataFrame, on_frame: Callable[[], None]) -> Iterator[Errors]:
    """Measure one dataset, in the order of the rows of its `truth`."""
    limits = read_limits(layout)
    if limits is None:
        raise InputError(f"{layout.root}: has no information limits; run vbaa-bench limits first")
    observations = open_observations(layout.observations)
    length_mm = observations.rig.beam.length / MILLIMETRE
    rungs = rungs_of(observations)
    trackers = [PushTracker(rung.antenna, rung.method) for rung in rungs]
    place = {name: number for number, name in enumerate(truth["frame_id"])}
    x_c, force = (truth[name].to_numpy() for name in ("x_c_mm", "force_n"))
    x_c_errors, force_errors = np.full((2, len(rungs), truth.height), np.nan)
    for frame in observations:
        at = place[frame.frame_id]
        image = frame.image()
        for number, tracker in enumerate(trackers):
            values = tracker.solve(image, frame.readings, frame.push_id).estimate.values
            error_mm = values.get("x_c_m", math.nan) / MILLIMETRE - x_c[at]
            x_c_errors[number, at] = 100 * error_mm / length_mm
            force_errors[number, at] = 100 * (values.get("force_n", math.nan) / force[at] - 1)
        on_frame()
    for rung, of_x_c, of_force in zip(rungs, x_c_errors, force_errors, strict=True):
        yield Errors(rung.name, of_x_c, of_force)
    planar = limits.filter(information="planar")
    rows = truth.select("frame_id").join(planar, on="frame_id", how="left", maintain_order="left")
    yield Errors(
        LIMIT,
        100 * rows["x_c_limit_mm"].to_numpy() / length_mm,
        100 * rows["force_limit_n"].to_numpy() / force,
    )


def _rms(errors: Floats) -> float:
    """Compute the root mean square of the finite errors; NaN if there are none."""
    finite = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else math.nan
