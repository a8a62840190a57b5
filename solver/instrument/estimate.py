"""Estimate of a method: an outcome, named values and their joint covariance."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from solver.instrument.arrays import Floats, freeze
from solver.instrument.quantities import QUANTITIES, QUANTITY_OF


class Outcome(StrEnum):
    """Outcome of an estimation; `sentence` explains it."""

    CONTACT = "contact"
    WEAK_CONTACT = "weak contact"
    TIP_CONTACT = "tip contact"
    NO_CONTACT = "no contact"
    NOT_IDENTIFIABLE = "not identifiable"
    EDGE_ON = "edge-on"
    INVALID = "invalid"
    NOT_CONVERGED = "not converged"
    CAMERA_MOVED = "camera moved"
    CRASHED = "crashed"

    @property
    def sentence(self) -> str:
        """Meaning of this outcome, as one sentence."""
        return _SENTENCES[self]

    @property
    def has_values(self) -> bool:
        """Whether an estimate with this outcome has values."""
        return self in (Outcome.CONTACT, Outcome.WEAK_CONTACT, Outcome.TIP_CONTACT)


_SENTENCES = {
    Outcome.CONTACT: "The beam touches an object at the estimated place.",
    Outcome.WEAK_CONTACT: "The beam bends so little that only an interval of x_c is known.",
    Outcome.TIP_CONTACT: "The contact lies within two sigma of the beam's tip.",
    Outcome.NO_CONTACT: "The beam is straight within the noise.",
    Outcome.NOT_IDENTIFIABLE: "The visible points do not determine the contact.",
    Outcome.EDGE_ON: "The camera looks along the plane in which the beam bends.",
    Outcome.INVALID: "A point contact cannot cause the measured shape.",
    Outcome.NOT_CONVERGED: "The iteration stopped before it reached a minimum.",
    Outcome.CAMERA_MOVED: "The camera or the clamp has moved since the images at rest.",
    Outcome.CRASHED: "The method failed or returned no estimate.",
}


class Assumption(StrEnum):
    """Statement of the rig, or assumption of a method, that a refused image contradicts.

    `sentence` explains it. A refusal that only says that the points do not fit names none.
    """

    TAPER = "taper"
    BOW = "bow"
    CLAMP = "clamp"
    FRICTION = "friction"
    TAPER_OR_FRICTION = "taper or friction"
    GRAVITY = "gravity"
    PLANE = "plane"
    SIDE = "side"
    LENGTH = "length"
    ONE_CONTACT = "one contact"
    RESTING_OBJECT = "resting object"
    MOTOR_AXIS = "motor axis"
    CAMERA_AT_REST = "camera at rest"
    LIGHT = "light"

    @property
    def sentence(self) -> str:
        """What is assumed, as one sentence."""
        return _ASSUMED[self]


_ASSUMED = {
    Assumption.TAPER: "The beam's width along its length is that of beam_shape.",
    Assumption.BOW: "The unloaded beam is as straight as beam_shape and the rest images state.",
    Assumption.CLAMP: "The clamp's pose and softness are those of rig.json.",
    Assumption.FRICTION: "The coefficient of friction is that of beam_shape.",
    Assumption.TAPER_OR_FRICTION: "Both are those of beam_shape; the image does not separate them.",
    Assumption.GRAVITY: "Gravity has the direction that rig.json states.",
    Assumption.PLANE: "The beam bends in the stated plane, as far as its section is round.",
    Assumption.SIDE: "Contact bends the beam to the side deflects_towards.",
    Assumption.LENGTH: "The beam is as long as rig.json states.",
    Assumption.ONE_CONTACT: "The beam touches at one place.",
    Assumption.RESTING_OBJECT: "During a push, the object moves only as a spring yields.",
    Assumption.MOTOR_AXIS: "The motor turns the clamp about the axis that rig.json states.",
    Assumption.CAMERA_AT_REST: "Camera and clamp are where they were in the rest images.",
    Assumption.LIGHT: "Exposure, gain and light are those of the rest images.",
}


# Columns that the representation of an estimate shows: label and unit.
_REPR_COLUMNS = {
    "x_c_mm": ("x_c", "mm"),
    "force_n": ("force", "N"),
    "psi_deg": ("psi", "deg"),
    "compliance_mm_per_n": ("1/k_s", "mm/N"),
}


class FittedParameter(NamedTuple):
    """Value of a parameter that a user's own beam has, and its standard deviation."""

    value: float
    sigma: float


@dataclass(frozen=True, repr=False)
class Estimate:
    """Estimate of contact and force from one frame.

    `values` maps some of QUANTITIES to numbers in SI units; a quantity that the method does not
    estimate is absent. `covariance` (n, n) is in the order of `values`; it is None if the method
    does not compute it. `parameters` are those of a beam of the user's own. `assumption` is what
    the image contradicts, if a failure outcome names one. `chi2` is the weighted sum of squared
    residuals with `dof` degrees of freedom.

    Every quantity is also an attribute, by its SI name or by its column in a table; it is None if
    it was not estimated:

    >>> estimate = Estimate(Outcome.CONTACT, values={"x_c_m": 0.12, "force_n": 0.05})
    >>> estimate.x_c_mm, estimate.force_n, estimate.psi_deg
    (120.0, 0.05, None)
    >>> estimate
    Estimate(contact: x_c 120 mm, force 0.05 N)

    Raises ValueError if a name is unknown, if a value is not finite, or if the shape of the
    covariance is wrong.
    """

    outcome: Outcome
    message: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    covariance: Floats | None = None
    chi2: float | None = None
    dof: int | None = None
    iterations: int | None = None
    assumption: Assumption | None = None
    parameters: Mapping[str, FittedParameter] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if bool(self.values) != self.outcome.has_values:
            raise ValueError(f"outcome '{self.outcome}' with values {dict(self.values)}")
        if self.assumption is not None and self.values:
            raise ValueError(f"an estimate with values contradicts the {self.assumption}")
        unknown = [name for name in self.values if name not in QUANTITIES]
        if unknown:
            raise ValueError(f"an estimate holds {unknown}, allowed are {', '.join(QUANTITIES)}")
        if not all(math.isfinite(value) for value in self.values.values()):
            raise ValueError(f"an estimate holds a value that is not finite: {dict(self.values)}")
        n = len(self.values)
        if self.covariance is not None:
            freeze(self, "covariance", (n, n))

    def sigma(self, name: str) -> float:
        """Return the standard deviation of a value, in the unit given in `name`.

        Raises ValueError if there is none.
        """
        return math.sqrt(max(float(self.covariance_of(name)[0, 0]), 0.0))

    def covariance_of(self, *names: str) -> Floats:
        """Return the covariance (n, n) of values, in the units given in their `names`.

        Raises ValueError if there is none.
        """
        if self.covariance is None:
            raise ValueError("the estimate has no covariance")
        quantities = [QUANTITY_OF.get(name, name) for name in names]
        for name, quantity in zip(names, quantities, strict=True):
            if quantity not in self.values:
                raise ValueError(f"the estimate has no {name}, but {', '.join(self.values)}")
        rows = [list(self.values).index(quantity) for quantity in quantities]
        units = np.array(
            [1.0 if name in QUANTITIES else QUANTITIES[QUANTITY_OF[name]].unit for name in names]
        )
        return np.asarray(self.covariance[np.ix_(rows, rows)] / np.outer(units, units))

    def correlation(self, one: str, other: str) -> float | None:
        """Return the correlation coefficient of two values, by their SI names.

        It is None without a covariance, and if a value is absent or has no variance.
        """
        names = list(self.values)
        if self.covariance is None or one not in names or other not in names:
            return None
        i, j = names.index(one), names.index(other)
        variances = float(self.covariance[i, i]) * float(self.covariance[j, j])
        return float(self.covariance[i, j]) / math.sqrt(variances) if variances > 0 else None

    def __getattr__(self, name: str) -> float | None:
        if name in QUANTITIES:
            return self.values.get(name)
        if name in QUANTITY_OF:
            value = self.values.get(QUANTITY_OF[name])
            return None if value is None else value / QUANTITIES[QUANTITY_OF[name]].unit
        raise AttributeError(f"an estimate has no {name!r}, but {', '.join(QUANTITY_OF)}")

    def __repr__(self) -> str:
        parts = []
        for name, (label, unit) in _REPR_COLUMNS.items():
            value = getattr(self, name)
            if value is not None:
                sigma = f" +- {self.sigma(name):.2g}" if self.covariance is not None else ""
                parts.append(f"{label} {value:.6g}{sigma} {unit}")
        summary = ", ".join(parts) or self.message or self.outcome.sentence
        return f"Estimate({self.outcome}: {summary})"
