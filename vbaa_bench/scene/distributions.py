"""Distributions that a scene may state in place of a value, such as `{uniform: [1, 5]}`."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import ConfigDict, Discriminator, Field, Tag, TypeAdapter, model_validator
from scipy.special import ndtr, ndtri

from solver.instrument.errors import quoted
from vbaa_bench.scene.part import Part, check_order

# How often a value is drawn: once per rig, for every push, or for every frame.
Level = Literal["rig", "push", "frame"]
LEVELS: Final[tuple[Level, ...]] = ("rig", "push", "frame")

# Values drawn or computed; Any, because the key itself checks them.
_Range = tuple[float, float]


class _Distribution(Part):
    """One random value per rig, per push or per frame.

    By default it is drawn once per rig, below `pushes` for every push, and within another
    distribution as often as that one.
    """

    per: Level = Field(
        default="rig",
        description="How often a value is drawn: once per rig, for every push, or for every frame.",
    )


class Uniform(_Distribution):
    """Uniform between two limits."""

    uniform: _Range = Field(description="Smallest and largest value.")

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_order("uniform", self.uniform)
        return self

    def value(self, unit: float) -> float:
        """Return the quantile at `unit`, from 0 to 1."""
        low, high = self.uniform
        return low + (high - low) * unit

    @property
    def extremes(self) -> tuple[float, ...]:
        """Smallest and largest value."""
        return self.uniform


class LogUniform(_Distribution):
    """Uniform in the logarithm, between two positive limits."""

    log_uniform: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]] = Field(
        description="Smallest and largest value."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_order("log_uniform", self.log_uniform)
        return self

    def value(self, unit: float) -> float:
        """Return the quantile at `unit`, from 0 to 1."""
        low, high = self.log_uniform
        # The power may exceed the limits by a rounding error.
        return float(min(max(low * (high / low) ** unit, low), high))

    @property
    def extremes(self) -> tuple[float, ...]:
        """Smallest and largest value."""
        return self.log_uniform


class Integers(_Distribution):
    """Whole numbers from low to high, both included, with equal probabilities."""

    integers: tuple[int, int] = Field(description="Smallest and largest number.")

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_order("integers", self.integers)
        return self

    def value(self, unit: float) -> int:
        """Return the quantile at `unit`, from 0 to 1."""
        low, high = self.integers
        return min(low + int((high - low + 1) * unit), high)

    @property
    def extremes(self) -> tuple[int, ...]:
        """Smallest and largest value."""
        return self.integers


class Normal(_Distribution):
    """Normal with a mean and a sigma, truncated: values outside of `clip` are never drawn."""

    normal: tuple[float, Annotated[float, Field(gt=0)]] = Field(description="Mean and sigma.")
    clip: _Range = Field(description="Smallest and largest value that is drawn.")

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_order("clip", self.clip)
        # Within 5 sigmas the probability between the limits is well above rounding errors.
        mean, sigma = self.normal
        if not self.clip[0] < mean + 5 * sigma or not self.clip[1] > mean - 5 * sigma:
            raise ValueError(
                f"clip is {list(self.clip)}, allowed is a range within five sigmas of the mean"
            )
        return self

    def value(self, unit: float) -> float:
        """Return the quantile at `unit`, from 0 to 1."""
        mean, sigma = self.normal
        low, high = (float(ndtr((end - mean) / sigma)) for end in self.clip)
        value = mean + sigma * float(ndtri(low + (high - low) * unit))
        return float(min(max(value, self.clip[0]), self.clip[1]))

    @property
    def extremes(self) -> tuple[float, ...]:
        """Smallest and largest value."""
        return self.clip


class Choice(_Distribution):
    """One of several values, lists or sections, which may contain distributions themselves."""

    choice: Annotated[tuple[Any, ...], Field(min_length=1)] = Field(
        description="The values, lists or sections of which one is drawn."
    )
    weights: tuple[Annotated[float, Field(ge=0)], ...] | None = Field(
        default=None, description="Relative probabilities, by default equal."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        weights = self.weights
        if weights is not None and (len(weights) != len(self.choice) or not sum(weights) > 0):
            raise ValueError(
                f"weights is {list(weights)}, allowed are {len(self.choice)} numbers, one for "
                "each choice, not all zero"
            )
        return self

    @property
    def relative_weights(self) -> tuple[float, ...]:
        """The weights, equal ones by default."""
        return self.weights or (1.0,) * len(self.choice)

    def value(self, unit: float) -> Any:
        """Return the option at `unit`, from 0 to 1, of the cumulative probability."""
        remaining = unit * sum(self.relative_weights)
        last = None
        for option, weight in zip(self.choice, self.relative_weights, strict=True):
            if remaining < weight:
                return option
            remaining -= weight
            last = option if weight > 0 else last
        return last


class From(_Distribution):
    """Another key's value, times a factor and plus a term, each a number or a distribution.

    Keys are written with dots, and items of lists by number: `camera.position_mm.0`.
    """

    model_config = ConfigDict(serialize_by_alias=True)

    source: Annotated[str, Field(alias="from", min_length=1)] = Field(description="The other key.")
    times: Any = Field(default=1, description="Factor, a number or a distribution.")
    plus: Any = Field(default=0, description="Term, a number or a distribution.")

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("times", "plus"):
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number and not isinstance(value, _Distribution):
                raise ValueError(
                    f"{name} is {quoted(value)}, allowed is a number or a distribution"
                )
        return self


_TYPES: Final[dict[str, type[_Distribution]]] = {
    "uniform": Uniform,
    "log_uniform": LogUniform,
    "integers": Integers,
    "normal": Normal,
    "choice": Choice,
    "from": From,
}


def kind(node: Any) -> str | None:
    """Return the name of the distribution that a mapping or an object states, or None."""
    if isinstance(node, _Distribution):
        return next(name for name, one in _TYPES.items() if isinstance(node, one))
    if not isinstance(node, Mapping):
        return None
    return next((name for name in _TYPES if name in node), None)


Distribution = Annotated[
    Annotated[Uniform, Tag("uniform")]
    | Annotated[LogUniform, Tag("log_uniform")]
    | Annotated[Integers, Tag("integers")]
    | Annotated[Normal, Tag("normal")]
    | Annotated[Choice, Tag("choice")]
    | Annotated[From, Tag("from")],
    Discriminator(kind),
]
SCALARS: Final = (Uniform, LogUniform, Integers, Normal)
DISTRIBUTIONS: Final = tuple(_TYPES.values())
ADAPTER: Final[TypeAdapter[Any]] = TypeAdapter(Distribution)


def elements(node: Mapping[str, Any]) -> Iterator[dict[str, Any]] | None:
    """Split a distribution of a vector or a colour into those of its elements.

    Both limits, or the mean, are lists of the same length. Return None for a single value.
    """
    name = kind(node)
    limits = node.get(name or "")
    if name not in ("uniform", "log_uniform", "integers", "normal") or not isinstance(
        limits, tuple
    ):
        return None
    lengths = {len(limit) for limit in limits if isinstance(limit, tuple)}
    if len(lengths) != 1:
        return None
    (length,) = lengths
    split = {key: _transposed(value, length) for key, value in node.items() if key != "per"}
    per = {"per": node["per"]} if "per" in node else {}
    return ({key: value[i] for key, value in split.items()} | per for i in range(length))


def _transposed(limits: Any, length: int) -> list[Any]:
    """Turn limits of vectors into the limits of each element; numbers count for all elements."""
    if not isinstance(limits, tuple):
        return [limits] * length
    return [
        tuple(limit[i] if isinstance(limit, tuple) else limit for limit in limits)
        for i in range(length)
    ]
