"""Errors of x_c of every frame, at every stage of the budget."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from solver.centreline import Centreline
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate
from solver.instrument.image_frame import ImageFrame
from solver.methods import Method
from solver.tracker import PushTracker
from vbaa_bench.benchmarks.budget.stages import Source, Stage, substitute_of, tip_lift
from vbaa_bench.benchmarks.budget.true_image import noisy, true_line
from vbaa_bench.benchmarks.budget.true_world import TrueFrame, TrueWorld

# Methods whose beam is that of eqs. (9) and (10); the others use the exact beam.
LINEAR: Final = {"two_point", "three_point", "moment_sensor", "linear_fit", "stiffness"}


class NamedMethod(NamedTuple):
    """A method and its name."""

    name: str
    function: Method


class Errors(NamedTuple):
    """Errors of x_c [m] of n frames: `by_stage` (stages, n) and `by_noise` (draws, n).

    The latter are errors with true points and simulated noise of the stated sigmas, at the second
    stage. NaN where a frame has no contact or was not answered, or where the solver's own beam does
    not exist. `sigma` (n,) [m] is the stated one, as measured.
    """

    by_stage: Floats
    by_noise: Floats
    sigma: Floats


class _Variant:
    """A stage after the first, with the memory of its push."""

    def __init__(self, stage: Stage, method: Method, world: TrueWorld) -> None:
        self._stage, self._camera = stage, world.camera
        self._tracker = PushTracker(stage.antenna, method)

    def error(
        self,
        image: Grey,
        frame: ImageFrame,
        measured: Centreline,
        true: TrueFrame,
        model: TrueFrame | None,
        random: np.random.Generator | None = None,
    ) -> float:
        """Return the error of x_c [m], at the stations of the `measured` line.

        With `random`, noise of the stated sigmas is added to the points. NaN without an answer.
        """
        source = true
        if self._stage.source is Source.MODEL:
            if model is None:
                return math.nan
            source = model
        keeps_tip = self._stage.source is Source.MEASURED_TIP
        lift = None if keeps_tip else tip_lift(self._stage.antenna)
        line = true_line(measured, self._camera, source.line, lift)
        substitute_of(self._stage.antenna).line = line if random is None else noisy(line, random)
        exact = self._stage.source in (Source.TRUE, Source.MODEL)
        readings = source.readings if exact else frame.readings
        estimate = self._tracker.solve(image, readings, frame.push_id).estimate
        return estimate.values.get("x_c_m", math.nan) - source.x_c


def errors_of(
    frames: Sequence[ImageFrame],
    rows: Sequence[Mapping[str, Any]],
    stages: Sequence[Stage],
    world: TrueWorld,
    method: NamedMethod,
    noise_draws: int,
    random: np.random.Generator,
    on_frame: Callable[[], None] = lambda: None,
) -> Errors:
    """Solve every frame at every stage with one method.

    `rows` are the frames' rows of the truth. Frames of a push follow one another in order.
    """
    measured = PushTracker(stages[0].antenna, method.function)
    variants = [_Variant(stage, method.function, world) for stage in stages[1:]]
    draws = [_Variant(stages[1], method.function, world) for _ in range(noise_draws)]
    by_stage = np.full((len(stages), len(frames)), np.nan)
    by_noise = np.full((noise_draws, len(frames)), np.nan)
    sigma = np.full(len(frames), np.nan)
    for i, (frame, row) in enumerate(zip(frames, rows, strict=True)):
        on_frame()
        try:
            image = frame.image()
        except InputError:
            continue
        true = world.frame(row, frame.readings)
        model = world.model_frame(row, frame.readings, method.name in LINEAR)
        solution = measured.solve(image, frame.readings, frame.push_id)
        estimate, line = solution.estimate, solution.line
        if line is None:
            continue
        by_stage[0, i] = estimate.values.get("x_c_m", math.nan) - true.x_c
        sigma[i] = _sigma(estimate)
        by_stage[1:, i] = [variant.error(image, frame, line, true, model) for variant in variants]
        by_noise[:, i] = [
            variant.error(image, frame, line, true, model, random) for variant in draws
        ]
    return Errors(by_stage, by_noise, sigma)


def _sigma(estimate: Estimate) -> float:
    if estimate.covariance is None or "x_c_m" not in estimate.values:
        return math.nan
    return estimate.sigma("x_c_m")
