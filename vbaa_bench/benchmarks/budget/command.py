"""Error budget of a dataset: its record, written into `derived/`."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from solver.antenna import Antenna
from solver.instrument.errors import InputError
from solver.instrument.observation import Observations, open_observations
from solver.methods import METHODS
from solver.set_up import set_up
from vbaa_bench.benchmarks.budget.errors import Errors, NamedMethod, errors_of
from vbaa_bench.benchmarks.budget.shares import shares_of, usable_frames
from vbaa_bench.benchmarks.budget.stages import stages_of
from vbaa_bench.benchmarks.budget.true_world import TrueWorld, open_world
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.report.budget import TOTAL
from vbaa_bench.scoring.bootstrap import group_numbers

# Chosen: on 30 frames the RMSE of the simulated noise then has a relative error of 6 %.
NOISE_DRAWS: Final = 4
# Fewer frames allow no interval.
MIN_FRAMES: Final = 2
# Decimals of the figures in % of L. Chosen: causes that are absent leave rounding errors of 1e-11.
_DECIMALS: Final = 8

_KEYS: Final = ("bias_pct_L", "rmse_pct_L", "low", "high")

Record = dict[str, dict[str, dict[str, float]]]


def budget(
    root: Path,
    methods: Sequence[str] = ("exact_fit",),
    noise_draws: int = NOISE_DRAWS,
    on_frame: Callable[[int], None] = lambda _frames: None,
) -> Record:
    """Split the errors of methods on a dataset into their causes; write `derived/budget.json`.

    Shares are in % of L, by method and cause, with the number of frames. `on_frame` is called once
    per frame and method, with the number of frames. Raises InputError, also for a method that
    answers too few frames. `methods` are names of `METHODS`.
    """
    layout = Layout(root)
    world = open_world(layout)
    observations = open_observations(layout.observations)
    antenna = set_up(observations)
    record = {
        name: _record(
            NamedMethod(name, METHODS[name]), observations, antenna, world, noise_draws, on_frame
        )
        for name in methods
    }
    data = (json.dumps(record, indent=2) + "\n").encode()
    write_results(layout.derived, {"budget.json": data})
    return record


def _record(
    method: NamedMethod,
    observations: Observations,
    antenna: Antenna,
    world: TrueWorld,
    noise_draws: int,
    on_frame: Callable[[int], None],
) -> dict[str, dict[str, float]]:
    """Compute the shares of one method as a record, in % of L."""
    rows = {row["frame_id"]: row for row in world.truth.frames.iter_rows(named=True)}
    frames = list(observations)
    stages = stages_of(antenna, world)
    errors = errors_of(
        frames,
        [rows[frame.frame_id] for frame in frames],
        stages,
        world,
        method,
        noise_draws,
        np.random.default_rng(0),
        lambda: on_frame(len(frames)),
    )
    usable = usable_frames(errors)
    if usable.sum() < MIN_FRAMES:
        raise InputError(
            f"{world.truth.root.parent}: {method.name} answers {usable.sum()} frames at every "
            f"stage, needed are {MIN_FRAMES}"
        )
    numbers = dict(
        zip(world.truth.frames["frame_id"], group_numbers(world.truth.frames), strict=True)
    )
    groups = np.array([numbers[frame.frame_id] for frame in frames])
    chosen = Errors(*(values[..., usable] for values in errors))
    shares = shares_of(chosen, [stage.cause for stage in stages], groups[usable])
    percent = 100 / observations.rig.beam.length
    return {
        name: {
            **{
                key: round(percent * value, _DECIMALS) + 0.0
                for key, value in zip(_KEYS, share, strict=True)
            },
            "frames": int(usable.sum()),
        }
        for name, share in shares.items()
    }


HEADS: Final = (
    "dataset",
    "method",
    "cause",
    "bias, % of L",
    "RMSE, % of L",
    "95 %",
    "of the square, %",
)


def rows(dataset: str, record: Record) -> list[dict[str, str | float]]:
    """Flatten the record of a dataset to one row per method and cause.

    Causes without any error are left out.
    """
    table: list[dict[str, str | float]] = []
    for method, shares in record.items():
        total = shares[TOTAL]["rmse_pct_L"]
        for cause, share in shares.items():
            rmse = share["rmse_pct_L"]
            if rmse:
                names: dict[str, str | float] = {
                    "dataset": dataset,
                    "method": method,
                    "cause": cause,
                }
                of_square = round(100 * rmse * abs(rmse) / total**2, 1)
                table.append(names | share | {"share_of_square_pct": of_square})
    return table


def cells(row: dict[str, str | float]) -> tuple[str, ...]:
    """Format a row of `rows` for a table with HEADS."""
    return (
        str(row["dataset"]),
        str(row["method"]),
        str(row["cause"]),
        f"{row['bias_pct_L']:+.2g}",
        f"{row['rmse_pct_L']:.2g}",
        f"{row['low']:.2g} to {row['high']:.2g}",
        f"{row['share_of_square_pct']:.0f}",
    )
