"""Random pushes for training sets."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.stats import qmc

from solver.instrument.arrays import Floats
from vbaa_bench.scene.part import ONSET, Onset, Part, Positive, Tilt

Percent = Annotated[float, Field(gt=0, lt=60)]


class SamplingSpec(Part):
    """`count` pushes, each of one step, drawn from the ranges below, whose ends may be equal.

    Uniform draws are independent; the grid has the same number of values on each axis, as near
    to `count` as that allows; a Latin hypercube (McKay 1979) has one sample in each of `count`
    layers of every axis. Log-uniform draws are spread over the logarithms of all positive axes.
    """

    method: Literal["uniform", "log_uniform", "grid", "latin_hypercube"] = "latin_hypercube"
    count: Annotated[int, Field(ge=1, le=1_000_000)]
    contact_distance_mm: tuple[Positive, Positive]
    deflection_pct: tuple[Percent, Percent]
    normal_deg: tuple[Tilt, Tilt] = (0.0, 0.0)
    # Of the object, by default rigid. Stiffnesses are always spread over their logarithms.
    stiffness_n_m: tuple[Positive, Positive] | None = None
    # Drawn uniformly from a separate random stream, whatever the method.
    motor_angle_at_contact_deg: Onset = ONSET

    @model_validator(mode="after")
    def _check_ranges(self) -> "SamplingSpec":
        for name in (*AXES, "motor_angle_at_contact_deg"):
            limits = getattr(self, name)
            if limits is not None and limits[0] > limits[1]:
                raise ValueError(f"{name} is {list(limits)}, allowed is a range from low to high")
        if self.method == "log_uniform" and min(self.normal_deg) < 0:
            raise ValueError(
                f"normal_deg is {list(self.normal_deg)}, allowed is >= 0 with method log_uniform"
            )
        return self

    def draw(self, random: np.random.Generator) -> list[dict[str, float]]:
        """Draw the pushes, each with a value for every axis that has a range."""
        axes = {name: getattr(self, name) for name in AXES if getattr(self, name) is not None}
        free = [name for name, (low, high) in axes.items() if low < high]
        unit_values = dict(zip(free, self._unit_points(len(free), random).T, strict=True))
        count = len(next(iter(unit_values.values()))) if unit_values else self.count
        return [
            {
                name: self._value(
                    name, limits, float(unit_values[name][i]) if name in unit_values else 0.0
                )
                for name, limits in axes.items()
            }
            for i in range(count)
        ]

    def _unit_points(self, axes: int, random: np.random.Generator) -> Floats:
        """Draw points (n, axes) of the unit cube."""
        if axes == 0:
            return np.empty((self.count, 0))
        if self.method == "grid":
            values_per_axis = max(round(self.count ** (1 / axes)), 1)
            centres = (np.arange(values_per_axis) + 0.5) / values_per_axis
            mesh = np.meshgrid(*[centres] * axes, indexing="ij")
            return np.column_stack([values.ravel() for values in mesh])
        if self.method == "latin_hypercube":
            return np.asarray(qmc.LatinHypercube(axes, rng=random).random(self.count))
        return random.random((self.count, axes))

    def _value(self, name: str, limits: tuple[float, float], fraction: float) -> float:
        low, high = limits
        over_logarithms = self.method == "log_uniform" or name == "stiffness_n_m"
        if over_logarithms and low > 0:
            return float(low * (high / low) ** fraction)
        return float(low + (high - low) * fraction)


AXES = ("contact_distance_mm", "deflection_pct", "normal_deg", "stiffness_n_m")
