"""How the beam and its clamp differ from a uniform beam on a rigid clamp."""

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats, freeze

# Coefficients of a bow, those of the rest images.
BOW: Final = 3
# Parameters of the covariance: the clamp's and the section's, and then the widths and the bow.
SOFTNESS, CLAMP_SHIFT, SKEW, FIRST_WIDTH = range(4)


class Friction(NamedTuple):
    """Coefficient of friction of unknown objects, and its sigma."""

    coefficient: float
    sigma: float


@dataclass(frozen=True)
class BeamShape:
    """Width along the beam, its clamp, a section out of round, friction; with their sigmas.

    `widths` (m,) are coefficients of the width over that at the clamp, 1 + s (c_0 + c_1 P_1(2 s -
    1) + ...), s the arc length over the beam's length; the flexural rigidity is proportional to its
    fourth power. `softness` is the clamp's rotation over its moment, in units of L / EI.
    `clamp_shift` is the place where the beam begins to bend, beyond the rig's clamp position and
    towards the tip, over the length: s is measured from there. `skew` [rad] is the angle from the
    plane of the force to that of the deflection, of a section that is not round, as psi in Sigma_a.
    `bow` are the coefficients (3,) of s^2, s^3, s^4 of the line at rest, over the length; it is
    empty where the bow was not learned, and is then that of the rest images. `covariance` is that
    of (softness, clamp_shift, skew, widths, bow). `section_sigma` is that of the section's second
    axis over its first, less one, in an unknown direction, and `rigidity_sigma` the relative one of
    EI for this reason; `friction_sigma` is that of the coefficient of friction of an unknown
    object. `rigid_objects` is whether objects do not yield, and the motor does not turn back while
    it pushes: the direction of friction then follows from the bend. `friction_coefficient` is that
    of the objects of the pushes from which it was learned, and `friction_sigma` then the difference
    of others from it; 0 if it was not learned. `bow_sigma` is that of the tip's distance from the
    clamp's tangent at rest, over the length; infinite if only the rest images show it. Raises
    ValueError if array shapes are inconsistent or a value is not finite or a sigma is negative.
    """

    widths: Floats = field(default_factory=lambda: np.zeros(0))
    softness: float = 0.0
    clamp_shift: float = 0.0
    skew: float = 0.0
    bow: Floats = field(default_factory=lambda: np.zeros(0))
    covariance: Floats = field(default_factory=lambda: np.zeros((FIRST_WIDTH,) * 2))
    section_sigma: float = 0.0
    rigidity_sigma: float = 0.0
    friction_sigma: float = 0.0
    rigid_objects: bool = False
    friction_coefficient: float = 0.0
    bow_sigma: float = math.inf

    def __post_init__(self) -> None:
        widths, bow = freeze(self, "widths", (None,)), freeze(self, "bow", (None,))
        if len(bow) not in (0, BOW):
            raise ValueError(f"the bow has {len(bow)} coefficients, allowed are none or {BOW}")
        count = FIRST_WIDTH + len(widths) + len(bow)
        freeze(self, "covariance", (count, count))
        for name in ("softness", "clamp_shift", "skew"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} is {getattr(self, name)}, allowed is a finite number")
        for name in ("section_sigma", "rigidity_sigma", "friction_sigma", "friction_coefficient"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, allowed is a number from 0")
        if not self.bow_sigma >= 0:
            raise ValueError(f"bow_sigma is {self.bow_sigma}, allowed is a number from 0")

    @property
    def uniform(self) -> bool:
        """Whether the beam is certainly uniform and frictionless, on a rigid clamp."""
        certain = not self.covariance.any() and not (self.section_sigma or self.ratio_sigma)
        of_clamp = self.softness or self.clamp_shift
        return certain and not (of_clamp or self.skew or self.widths.any() or len(self.bow))

    @property
    def is_learned(self) -> bool:
        """Whether the beam differs from a uniform one of stated sigmas, as a learned one does."""
        stated = stated_shape(
            self.taper_sigma,
            self.sigma(SOFTNESS),
            self.section_sigma,
            self.friction_sigma,
            self.sigma(CLAMP_SHIFT),
        )
        values = [self.softness, self.clamp_shift, self.skew, *self.widths, *self.bow]
        return any(values) or not np.array_equal(self.covariance, stated.covariance)

    @property
    def taper_sigma(self) -> float:
        """Standard deviation of the first coefficient of the width; 0 without one."""
        return self.sigma(FIRST_WIDTH) if len(self.widths) else 0.0

    @property
    def ratio_sigma(self) -> float:
        """Standard deviation of a friction ratio whose direction is not known."""
        return math.hypot(self.friction_coefficient, self.friction_sigma)

    @property
    def friction(self) -> Friction:
        """Coefficient of friction: as learned, or of a ratio that is normally distributed."""
        if self.friction_coefficient:
            return Friction(self.friction_coefficient, self.friction_sigma)
        # Mean and standard deviation of the half of a normal distribution.
        mean = math.sqrt(2 / math.pi)
        return Friction(mean * self.friction_sigma, math.sqrt(1 - mean**2) * self.friction_sigma)

    def sigma(self, parameter: int) -> float:
        """Return the standard deviation of a parameter of the covariance."""
        return math.sqrt(self.covariance[parameter, parameter])


UNIFORM = BeamShape()
# Sigmas of a beam about which a laboratory states nothing: drawn wire in a chuck, against dry
# objects. Chosen: diameters of drawn wire vary by 1 to 3 % (ISO 286, h10 to h11 at 0.5 mm), dry
# metals have coefficients of friction of 0.15 to 0.3, and a chuck turns by a minute of arc or two.
TAPER_SIGMA: Final = 0.02
SECTION_SIGMA: Final = 0.02
FRICTION_SIGMA: Final = 0.2
SOFTNESS_SIGMA: Final = 0.002


def skew_sigma(section: float) -> float:
    """Compute the sigma [rad] of the angle between the planes of the force and of the deflection.

    With axes in the ratio 1 + e, at an angle a to the force, it is e sin(2 a) to first order.
    """
    return section / math.sqrt(2)


def stated_shape(
    taper: float,
    softness: float,
    section: float,
    friction: float,
    clamp_shift: float = 0.0,
    rigid_objects: bool = False,
    bow_sigma: float = math.inf,
) -> BeamShape:
    """Return a beam that was not learned: a uniform one, with the stated sigmas.

    `taper` is the sigma of the tip's width over that at the clamp, `clamp_shift` that of the place
    where the beam begins to bend, over the length. With a section's axes in the ratio 1 + e, at an
    angle a to the force, EI is larger by 2 e sin(a)^2, to first order.
    """
    widths = np.zeros(1 if taper else 0)
    sigmas = np.array([softness, clamp_shift, skew_sigma(section), *([taper] if taper else [])])
    return BeamShape(
        widths=widths,
        covariance=np.diag(sigmas**2),
        section_sigma=section,
        rigidity_sigma=section * math.sqrt(1.5),
        friction_sigma=friction,
        rigid_objects=rigid_objects,
        bow_sigma=bow_sigma,
    )
