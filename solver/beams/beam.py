"""What a fit requires of a beam: its shapes under a contact, with gradients.

All lengths are in units of the beam's length. The parameters of a shape are

    q               force across the beam over EI at the clamp
    s_c             arc length of the contact from where the beam begins to bend
    friction_ratio  the force's component along the beam over that across it, towards the tip

and then the beam's own, as those of its width and of its bow at rest. A fit adds the clamp's:

    psi            inclination of the deformation plane D against the calibration plane C
    dx, dy, tilt   the clamp's position on C, and the rotation of its tangent without load
    softness       rotation of a clamp that gives, over its moment in units of EI / L
"""

from collections.abc import Mapping
from typing import Final, NamedTuple, Protocol

from solver.beams.curve import Curve
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats

# The first parameters of a shape, and those of the clamp, counted from the end of the shape's.
Q, S_C, FRICTION_RATIO, OWN = range(4)
PSI, DX, DY, TILT, SOFTNESS, POSE = range(6)
CONTACT: Final = (("q", 1), ("s_c", 1), ("friction_ratio", 1))
CLAMP: Final = (("psi", 1), ("dx", 1), ("dy", 1), ("tilt", 1), ("softness", 1))


# The block of errors that many points share, which follows the clamp's parameters.
ERRORS: Final = "errors"


class Prior(NamedTuple):
    """Mean of a parameter of a beam's own, before any image, and its sigma, 0 if it is certain."""

    mean: float
    sigma: float


class BentBeam(NamedTuple):
    """A shape: its curve, its contacts, and the moment at its clamp [EI / L].

    `contacts` (c, 6) are (force over EI, tangent's angle theta_c, x_c, y_c, s_c, lean) in the frame
    of the clamp's tangent, from the clamp outwards; lean is the angle from the beam's normal to the
    force, back to the clamp. `by_contacts` (c, 6, k) and `by_moment` (k,) are gradients by the
    parameters of the shape.
    """

    curve: Curve
    contacts: Floats
    by_contacts: Floats
    moment: float
    by_moment: Floats


class Radius(NamedTuple):
    """Radius of a beam at an arc length, and its gradient (k,) by the shape's parameters.

    The gradient by the arc length has the place of S_C.
    """

    value: float
    gradient: Floats


def with_clamp(parameters: Parameters) -> Parameters:
    """Return the parameters of a shape, followed by the clamp's."""
    return parameters.followed_by(*CLAMP)


class Beam(Protocol):
    """Shapes of a beam on its clamp, by the k parameters that `parameters` names."""

    @property
    def parameters(self) -> Parameters:
        """Parameters of a shape; those of the bow are the block "bow"."""
        ...

    @property
    def radius(self) -> float:
        """Radius at the clamp."""
        ...

    @property
    def prior(self) -> Mapping[str, Prior]:
        """Parameters besides those of contact, width and bow, each of one number, by name."""
        ...

    @property
    def positive(self) -> tuple[int, ...]:
        """Indices of parameters that stay positive, and at most double in one step of a fit."""
        ...

    def bent(self, p: Floats) -> BentBeam | None:
        """Compute the shape with parameters p (k,); None if no beam has it."""
        ...

    def radius_at(self, p: Floats, s: float) -> Radius:
        """Compute the radius at the arc length s."""
        ...

    def after_step(self, p: Floats, step: Floats, ray: float) -> Floats:
        """Return shape and clamp (k + 5,) after a step of a fit from p, along a curved valley.

        `ray` is y_v / z_v of the rays to the camera.
        """
        ...
