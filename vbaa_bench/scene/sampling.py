"""Random pushes for training sets."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from solver.instrument.arrays import Floats
from vbaa_bench.scene.part import ONSET, Onset, Part, Positive, Tilt, check_order
from vbaa_bench.scene.push import MAX_FRAMES, Deflection
from vbaa_bench.scene.unit_values import Draw, unit_value


class SamplingSpec(Part):
    """`count` pushes, each of one step, drawn from the ranges below, whose ends may be equal.

    A larger count keeps the pushes of a smaller one, except on a grid. Scrambled Sobol points fill
    all axes together evenly; uniform draws are independent; the grid has the same number of values
    on each axis, as near to `count` as that allows. Log-uniform draws are independent, and spread
    over the logarithms of all positive axes.
    """

    method: Literal["sobol", "uniform", "log_uniform", "grid"] = Field(
        default="sobol",
        description="How pushes are drawn: sobol fills all axes together evenly, uniform and "
        "log_uniform draw independently, grid has the same number of values on each axis.",
    )
    count: Annotated[int, Field(ge=1, le=MAX_FRAMES)] = Field(
        description="Number of pushes, each of one step."
    )
    contact_distance_mm: tuple[Positive, Positive] = Field(
        description="Range of the contact distance."
    )
    deflection_pct: tuple[Deflection, Deflection] = Field(
        description="Range of the tip's displacement across the beam over the length."
    )
    normal_deg: tuple[Tilt, Tilt] = Field(
        default=(0.0, 0.0),
        description="Range of the tilt nu of the touched edge's normal out of plane C.",
    )
    stiffness_n_m: tuple[Positive, Positive] | None = Field(
        default=None,
        description="Range of the object's stiffness, spread over its logarithm; by default "
        "the object is rigid.",
    )
    motor_angle_at_contact_deg: Onset = Field(
        default=ONSET,
        description="Range from which the motor's angle is drawn uniformly, whatever the "
        "method; see `pushes`.",
    )

    @field_validator("method", mode="before")
    @classmethod
    def _check_method(cls, method: Any) -> Any:
        if method == "latin_hypercube":
            raise ValueError(
                "is latin_hypercube, allowed is sobol: its points fill the axes as evenly, and do "
                "not change when count grows"
            )
        return method

    @model_validator(mode="after")
    def _check_ranges(self) -> "SamplingSpec":
        for name in (*AXES, "motor_angle_at_contact_deg"):
            limits = getattr(self, name)
            if limits is not None:
                check_order(name, limits)
        if self.method == "log_uniform" and min(self.normal_deg) < 0:
            raise ValueError(
                f"normal_deg is {list(self.normal_deg)}, allowed is >= 0 with method log_uniform"
            )
        return self

    @property
    def grows(self) -> bool:
        """Whether a larger count keeps the pushes of a smaller one."""
        return self.method != "grid"

    def draw(self, seed: int) -> "DrawnPushes":
        """Draw the pushes."""
        axes = {name: getattr(self, name) for name in AXES if getattr(self, name) is not None}
        free = [name for name, (low, high) in axes.items() if low < high]
        fractions = self._fractions(free, seed)
        count = len(next(iter(fractions.values()), range(self.count)))
        return DrawnPushes(self, axes, fractions, count)

    def _fractions(self, axes: list[str], seed: int) -> dict[str, Floats]:
        """Draw numbers from 0 to 1, an array for each axis, independent of the other axes."""
        match self.method:
            case "grid":
                values_per_axis = max(round(self.count ** (1 / max(len(axes), 1))), 1)
                centres = (np.arange(values_per_axis) + 0.5) / values_per_axis
                mesh = np.meshgrid(*[centres] * len(axes), indexing="ij")
                return {name: values.ravel() for name, values in zip(axes, mesh, strict=True)}
            case "sobol":
                from scipy.stats import qmc  # takes a third of a second, for this method alone

                # An axis has the same dimension whichever others are random.
                points = qmc.Sobol(len(AXES), rng=np.random.default_rng([seed, _STREAM]))
                columns = points.random_base2((self.count - 1).bit_length())[: self.count].T
                return {name: columns[AXES.index(name)] for name in axes}
        return {
            name: np.random.default_rng([seed, _STREAM, AXES.index(name)]).random(self.count)
            for name in axes
        }

    def value(self, name: str, limits: tuple[float, float], fraction: float) -> float:
        """Return the value of an axis at a fraction, 0 to 1, of its range."""
        low, high = limits
        over_logarithms = self.method == "log_uniform" or name == "stiffness_n_m"
        if over_logarithms and low > 0:
            return float(low * (high / low) ** fraction)
        return float(low + (high - low) * fraction)


@dataclass(frozen=True)
class DrawnPushes:
    """Drawn pushes by number, each with a value for every axis that has a range.

    Only the fractions of the ranges are kept, because a training set has a million pushes.
    """

    _spec: SamplingSpec
    _axes: Mapping[str, tuple[float, float]]
    _fractions: Mapping[str, Floats]
    _count: int

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[dict[str, float]]:
        return map(self.__getitem__, range(self._count))

    def __getitem__(self, number: int) -> dict[str, float]:
        return {
            name: self._spec.value(
                name, limits, float(self._fractions[name][number]) if name in self._fractions else 0
            )
            for name, limits in self._axes.items()
        }


class SplitSpec(Part):
    """Shares of a set for training and testing, such as {train: 0.8, val: 0.1, test: 0.1}.

    Each push, or each rig of a collection, belongs to one of them, never single frames of a push.
    They are filled evenly, and keep their members when the set grows.
    """

    by: Literal["push", "rig"] = Field(
        default="push",
        description="Whether whole pushes, or whole rigs of a collection, belong to a part.",
    )
    shares: Annotated[dict[str, Annotated[float, Field(gt=0, le=1)]], Field(min_length=1)] = Field(
        description="Share of each part by its name; they add up to 1."
    )

    @model_validator(mode="after")
    def _check_sum(self) -> "SplitSpec":
        total = sum(self.shares.values())
        if abs(total - 1) > 1e-9:
            raise ValueError(f"shares add up to {total:g}, allowed is 1")
        return self

    def name(self, seed: int, number: int) -> str:
        """Return the split of a push or a rig."""
        unit = unit_value(seed, "sobol", Draw("split", number), self.by)
        bounds = np.cumsum(list(self.shares.values()))
        return list(self.shares)[min(int(np.searchsorted(bounds, unit, "right")), len(bounds) - 1)]


# Number of the random stream, chosen.
_STREAM: Final = 1
AXES: Final = ("contact_distance_mm", "deflection_pct", "normal_deg", "stiffness_n_m")
