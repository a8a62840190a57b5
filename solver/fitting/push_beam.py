"""The beam of a push: what differs between a uniform beam and one of changing section."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from solver.beams.frictional import Contact
from solver.fitting.push_geometry import FirstTouch
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement


class PushPrior(NamedTuple):
    """Mean (b,) of the parameters of beam and clamp, and a root (b, b) of their information."""

    mean: Floats
    root: Floats


class LastShape(NamedTuple):
    """Values (m,) by name of a frame, and their Jacobian (m, b + 6).

    The Jacobian is by q, place, the parameters of beam and clamp, friction ratio, motor angle, and
    the relative errors of EI and of all lengths, of which `input_variances` (2,) are those of the
    last two. `placement` (m, m) is the covariance due to the error of Sigma_a.
    """

    values: dict[str, float]
    jacobian: Floats
    input_variances: Floats
    placement: Floats


class PushBeam(Protocol):
    """Shapes of one beam on its clamp, which all frames of a push share.

    A shape has the parameters q, the force across the beam over EI at the clamp [1/m^2]; its place,
    which determines the contact; the friction ratio; and b parameters of beam and clamp.
    """

    @property
    def points(self) -> int:
        """Number of points in all frames."""
        ...

    @property
    def prior(self) -> PushPrior:
        """PushPrior of the parameters of beam and clamp."""
        ...

    @property
    def own(self) -> Mapping[str, int]:
        """Places of the parameters of a user's own beam among those of beam and clamp, by name."""
        ...

    def farthest(self, q: Floats, friction_ratio: Floats) -> Floats:
        """Compute the largest places (n,) of shapes."""
        ...

    def contacts(
        self, q: Floats, place: Floats, friction_ratio: Floats, beam: Floats
    ) -> Contact | None:
        """Compute the contacts (n,) of shapes, relative to the clamp's tangent without load.

        The gradients (k, n) are by q, place, friction ratio, and then by the parameters of beam and
        clamp, or by none of them where they have no effect. Returns None if a shape does not exist.
        """
        ...

    def first_touch(self, x0: float, beam: Floats) -> FirstTouch:
        """Compute the line of the beam at first contact; its gradients are as in `contacts`."""
        ...

    def rows(
        self, frame: int, q: float, place: float, friction_ratio: float | None, beam: Floats
    ) -> Floats | None:
        """Compute rows in sigmas: residual, Jacobian by q, place, beam, clamp, friction ratio.

        They have the sum of squares and the gradient of all points (QR), so that the size of a
        joint problem depends only on the number of frames. Errors that all points share, and that
        are not among the parameters, follow in more columns. The friction ratio is None without
        friction. Returns None if the shape does not exist.
        """
        ...

    def last_shape(
        self,
        last: Measurement,
        q: float,
        place: float,
        beam: Floats,
        friction_ratio: float | None,
        motor_angle: float,
    ) -> LastShape:
        """Compute the values of the last frame, whose shape has these parameters."""
        ...


class PushFrame(NamedTuple):
    """Bent frame: motor angle [rad], and whether the beam was free before."""

    motor_angle: float
    begins: bool = False
