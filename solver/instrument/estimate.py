"""What a method answers: an outcome, named values and their joint covariance."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from solver.instrument.arrays import Floats, frozen_floats


class Outcome(StrEnum):
    """How an estimation ended; `sentence` says it to a person."""

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
        """What this outcome means."""
        return _SENTENCES[self]

    @property
    def has_values(self) -> bool:
        """Whether an estimate with this outcome carries numbers."""
        return self in (Outcome.CONTACT, Outcome.WEAK_CONTACT, Outcome.TIP_CONTACT)


# What an estimate may hold, by name with its SI unit.
# In Sigma_d: contact distance, its deflection, contact arc length, |force|, the force's component
# across the undeformed beam (eq. 11), the tangent's angle at the contact; psi inclines D against C.
# In Sigma_a and Sigma_o, as `antenna` and `world`: the contact point, eqs. (1)-(5); the force on
# the beam; by how much the beam has moved at the contact, eqs. (28), (29).
# Of a push: the object's compliance 1/k_s, k_s itself where it is told apart from rigid, Coulomb's
# coefficient, and the motor's angle at first contact.
QUANTITIES = (
    "x_c_m",
    "y_c_m",
    "s_c_m",
    "force_n",
    "f_n",
    "theta_c_rad",
    "psi_rad",
    "contact_antenna_x_m",
    "contact_antenna_y_m",
    "contact_antenna_z_m",
    "contact_world_x_m",
    "contact_world_y_m",
    "contact_world_z_m",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "displacement_y_m",
    "displacement_z_m",
    "compliance_m_per_n",
    "stiffness_n_per_m",
    "friction",
    "onset_angle_rad",
    "motor_angle_rad",
)

_KNOWN = frozenset(QUANTITIES)
_SENTENCES = {
    Outcome.CONTACT: "The beam touches an object at the stated place.",
    Outcome.WEAK_CONTACT: "The beam is bent, but so little that the place is only an interval.",
    Outcome.TIP_CONTACT: "The contact lies within two sigma of the beam's tip.",
    Outcome.NO_CONTACT: "The beam is straight within the noise.",
    Outcome.NOT_IDENTIFIABLE: "What is visible does not determine the contact.",
    Outcome.EDGE_ON: "The camera looks along the plane in which the beam bends.",
    Outcome.INVALID: "The measured shape is not one that a point contact can make.",
    Outcome.NOT_CONVERGED: "The iteration stopped before it reached a minimum.",
    Outcome.CAMERA_MOVED: "The camera or the clamp has moved since the images at rest.",
    Outcome.CRASHED: "The method raised an error or gave no answer.",
}


@dataclass(frozen=True)
class Estimate:
    """One frame's answer.

    `values` maps some of QUANTITIES to numbers in SI units; what a method does not estimate is
    absent. `covariance` (n, n) follows the order of `values`; None where a method does not know
    it. `chi2` is the weighted sum of squared residuals on `dof` degrees of freedom.
    Raises ValueError if a name is unknown, a value not finite, or the covariance does not fit.
    """

    outcome: Outcome
    message: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    covariance: Floats | None = None
    chi2: float | None = None
    dof: int | None = None
    iterations: int | None = None

    def __post_init__(self) -> None:
        if bool(self.values) != self.outcome.has_values:
            raise ValueError(f"outcome '{self.outcome}' with values {dict(self.values)}")
        unknown = [name for name in self.values if name not in _KNOWN]
        if unknown:
            raise ValueError(f"an estimate holds {unknown}, allowed are {', '.join(QUANTITIES)}")
        if not all(math.isfinite(value) for value in self.values.values()):
            raise ValueError(f"an estimate holds a value that is not finite: {dict(self.values)}")
        n = len(self.values)
        if self.covariance is not None:
            covariance = frozen_floats("covariance", self.covariance, (n, n))
            object.__setattr__(self, "covariance", covariance)

    def sigma(self, name: str) -> float:
        """Standard deviation of a value, in its own unit. Raises ValueError if it is not known."""
        if self.covariance is None:
            raise ValueError("the estimate states no covariance")
        index = list(self.values).index(name)
        return math.sqrt(max(float(self.covariance[index, index]), 0.0))
