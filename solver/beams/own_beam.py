"""A beam of a user's own: what bends it besides the contact is stated in a few lines.

The line of the beam and the moments on it depend on each other: the line is integrated from the
curvature, and the curvature computed from the line, until it does not move (Picard's iteration).
Gradients are central differences. All lengths are in units of the beam's length, in the frame of
the clamp's tangent: x along it, y to the side to which contact bends the beam.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final, NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from solver.beams.beam import ERRORS, FRICTION_RATIO, S_C, BentBeam, Prior, Q, with_clamp
from solver.beams.curve import END, MOST_ANGLE, Curve
from solver.beams.integrated import IntegratedBeam, straight_in_moments
from solver.beams.stretch import LEAST_WIDTH
from solver.core.parameters import Parameters
from solver.instrument.arrays import Floats

# Steps of the integration between two of clamp, breaks, contact and end. Measured: a contact of the
# beam of `integrated` is met to 3e-7 when it is bent by 48 degrees, and to 2e-8 by 13 degrees.
_STEPS: Final = 32
# Largest change of a place in the last iteration, and most iterations. Chosen: a beam that is bent
# by 71 degrees takes 8.
_TOLERANCE: Final = 1e-13
_MAX_ITERATIONS: Final = 80
# Part of a panel from its end to its first place. Chosen: the error is this part of the curvature.
_INSIDE: Final = 1e-9
# Step of differences. Chosen: rounding and truncation change a gradient by about 1e-8.
_STEP: Final = 1e-5


class Line(NamedTuple):
    """Lines of v beams at m arc lengths: `s`, `x`, `y` (v, m), and the tangent's angle (v, m).

    The contact is at the index `contact`, and again at the next one, where the part without load
    begins. Arc lengths of breaks are doubled too, with one value on either side. The last arc
    length is a little beyond the tip, which is at s = 1.
    """

    s: Floats
    x: Floats
    y: Floats
    angle: Floats
    contact: int

    def at_tip(self, values: Floats) -> Floats:
        """Interpolate values (v, m) to the tip: (v, 1)."""
        rows = zip(self.s, values, strict=True)
        return np.array([[np.interp(1.0, s, value)] for s, value in rows])


@dataclass(frozen=True)
class OwnBeam(IntegratedBeam):
    """A beam whose curvature or stiffness a subclass states, as a `Beam`.

    It has the width, bow and contact of `IntegratedBeam`. `prior` may name more parameters.
    `breaks` are arc lengths at which the curvature jumps, besides the contact's.
    """

    breaks: ClassVar[tuple[float, ...]] = ()

    @cached_property
    def parameters(self) -> Parameters:
        """Those of the contact, of the width and of the bow, and then those of the `prior`.

        Raises ValueError if the prior has a name that is taken, or is not a mean and a sigma, and
        if `breaks` are no arc lengths over the beam's.
        """
        if not (isinstance(self.breaks, tuple) and all(0 < s <= 1 for s in self.breaks)):
            raise ValueError(
                f"breaks is {self.breaks!r}, allowed is a tuple of arc lengths over the beam's, "
                "above 0 and at most 1"
            )
        shared = self.of_section()
        taken = with_clamp(shared)
        for name, prior in self.prior.items():
            if name in taken or name == ERRORS:
                raise ValueError(f"prior of '{name}': the name is taken; those of a beam are free")
            if not isinstance(prior, Prior):
                raise ValueError(f"prior of '{name}' is {prior!r}, allowed is Prior(mean, sigma)")
            if not (math.isfinite(prior.mean) and 0 <= prior.sigma < math.inf):
                raise ValueError(f"prior of '{name}' is {prior}, allowed are numbers, sigma >= 0")
        return shared.followed_by(*((name, 1) for name in self.prior))

    def curvature(self, line: Line, p: Mapping[str, Floats]) -> Floats:
        """Compute the curvature (v, m) of v beams that have this line.

        `p` has their parameters by name: (v, 1), and (v, size) of "widths" and "bow". It is the
        moment of the contact's force over the `stiffness`, and the curvature at rest. A subclass
        adds what else bends the beam.
        """
        return np.asarray(self.by_contact(line, p) / self.stiffness(line, p) + _at_rest(line, p))

    def by_contact(self, line: Line, p: Mapping[str, Floats]) -> Floats:
        """Compute the moment (v, m) of the contact's force over EI at the clamp."""
        angle, i = line.angle[:, [line.contact]], line.contact
        sine, cosine = np.sin(angle), np.cos(angle)
        # Across the beam and, by friction, along it, on the side from which the force comes.
        radius = self.radius * self.width(line, p)[:, [i]]
        arm_x = line.x[:, [i]] + radius * sine - line.x
        arm_y = line.y[:, [i]] - radius * cosine - line.y
        force_x = p["q"] * (p["friction_ratio"] * cosine - sine)
        force_y = p["q"] * (p["friction_ratio"] * sine + cosine)
        moment = arm_x * force_y - arm_y * force_x
        moment[:, i + 1 :] = 0.0
        return np.asarray(moment)

    def stiffness(self, line: Line, p: Mapping[str, Floats]) -> Floats:
        """Compute EI (v, m) over that of the rig at the clamp: the fourth power of the width."""
        return np.asarray(self.width(line, p) ** 4)

    def width(self, line: Line, p: Mapping[str, Floats]) -> Floats:
        """Compute the width (v, m) over that at the clamp."""
        if not self.widths:
            return np.ones(line.s.shape)
        terms = np.polynomial.legendre.legvander(2 * line.s - 1, self.widths - 1)
        width = 1 + line.s * (terms * p["widths"][:, None]).sum(axis=-1)
        return np.asarray(np.maximum(width, LEAST_WIDTH))

    def bent(self, p: Floats) -> BentBeam | None:
        """Compute the shape with parameters p (k,); None if no beam has it.

        Raises ValueError if the curvature is not one number for each place of each beam.
        """
        inside = 0 < p[S_C] < END and abs(p[FRICTION_RATIO]) < np.tan(MOST_ANGLE)
        if p[Q] < 0 or not inside:
            return None
        k = len(p)
        steps = _STEP * np.vstack([np.eye(k), -np.eye(k)])
        lines = self._lines(np.vstack([p, p + steps]))
        if lines is None:
            return None
        line, curvature, named = lines
        moment = (curvature - _at_rest(line, named)) * self.stiffness(line, named)
        return _as_bent(lines, moment[:, 0])

    def after_step(self, p: Floats, step: Floats, ray: float) -> Floats:
        """Return shape and clamp (k + 5,) after a step, by linear theory."""
        del ray
        return straight_in_moments(p, step)

    def _lines(self, rows: Floats) -> "_Lines | None":
        """Find the lines of beams with parameters (v, k); None where the iteration does not end."""
        at = self.parameters
        named = {name: rows[:, at.span(name)] for name, _ in at.blocks}
        place = named["s_c"]
        before = sorted(s for s in self.breaks if 0 < s < place[0, 0])
        beyond = sorted(s for s in self.breaks if place[0, 0] <= s < END)
        one = np.ones_like(place)
        # Ends of the panels (v, panels + 1).
        ends = np.hstack([0 * one, one * before, place, one * beyond, END * one])
        share = np.linspace(0.0, 1.0, _STEPS + 1)
        # The first and last places of a panel are inside it: a jump is at its end.
        share[0], share[-1] = _INSIDE, 1 - _INSIDE
        lengths = np.diff(ends, axis=1)
        s = (ends[:, :-1, None] + lengths[:, :, None] * share).reshape(len(rows), -1)
        zero, contact = np.zeros_like(s), (1 + len(before)) * (_STEPS + 1) - 1
        line = Line(s, s.copy(), zero, zero, contact)
        for _ in range(_MAX_ITERATIONS):
            curvature = self.curvature(line, named)
            if np.shape(curvature) != s.shape:
                raise ValueError(
                    f"the curvature of {type(self).__name__} has shape {np.shape(curvature)}, "
                    f"allowed is {s.shape}"
                )
            angle = _integrated(curvature, lengths)
            x, y = _integrated(np.cos(angle), lengths), _integrated(np.sin(angle), lengths)
            moved = max(np.abs(x - line.x).max(), np.abs(y - line.y).max())
            line = line._replace(x=x, y=y, angle=angle)
            if moved < _TOLERANCE:
                turned = np.abs(angle - angle[:, [contact]])
                return _Lines(line, curvature, named) if turned.max() < MOST_ANGLE else None
            if not np.abs(angle).max() < np.pi:
                break
        return None


class _Lines(NamedTuple):
    """Lines of v beams, their curvature (v, m), and their parameters by name."""

    line: Line
    curvature: Floats
    p: dict[str, Floats]


def _at_rest(line: Line, p: Mapping[str, Floats]) -> Floats:
    """Compute the curvature at rest (v, m)."""
    orders = np.arange(2, 2 + p["bow"].shape[1])
    powers = line.s[..., None] ** (orders - 2)
    return np.asarray((orders * (orders - 1) * powers * p["bow"][:, None]).sum(axis=-1))


def _integrated(rate: Floats, lengths: Floats) -> Floats:
    """Integrate a rate (v, m) over the arc length, panel by panel of these lengths (v, n)."""
    panels = rate.reshape(*lengths.shape, -1)
    step = lengths[:, :, None] / _STEPS
    within = cumulative_simpson(panels, dx=step, axis=2, initial=0.0)
    before = np.cumsum(within[:, :, -1], axis=1) - within[:, :, -1]
    return np.asarray((within + before[:, :, None]).reshape(rate.shape))


def _as_bent(lines: _Lines, moment: Floats) -> BentBeam:
    """Convert a line, with those of parameters ahead and behind, to a shape with gradients.

    `moment` (v,) is that at the clamp. The axes of the curve are along and across the contact's
    tangent.
    """
    line, curvature, p = lines
    i = line.contact
    axis = line.angle[0, i]
    cosine, sine = np.cos(axis), np.sin(axis)
    along, across = line.x * cosine + line.y * sine, line.y * cosine - line.x * sine
    turned = line.angle - axis
    secant = 1 / np.cos(turned[0])
    slope, bend = -np.tan(turned[0]), curvature[0] * secant**3
    by_u, by_p, by_slope = -_gradient(along), _gradient(across), -(secant**2) * _gradient(turned)
    # From the tip to the clamp; gradients at constant u.
    nodes = np.array([-along[0], across[0], slope, bend])[:, ::-1]
    gradients = np.stack([by_p - slope * by_u, by_slope - bend * by_u], axis=1)[:, :, ::-1]
    k, last = len(gradients), line.s.shape[1] - 1
    root, lean = np.hypot(1.0, p["friction_ratio"]), -np.arctan(p["friction_ratio"])
    quantities = np.hstack(
        [p["q"] * root, line.angle[:, [i]], line.x[:, [i]], line.y[:, [i]], p["s_c"], lean]
    )
    curve = Curve(
        nodes=np.ascontiguousarray(nodes),
        gradients=np.ascontiguousarray(gradients),
        contact=last - i - 1,
        by_arm=by_u[:, i],
        base=np.array([0.0, 0.0, axis]),
        by_base=np.zeros((k, 3)),
        exists=True,
    )
    by_contact = np.ascontiguousarray(_gradient(quantities).T)
    return BentBeam(curve, quantities[:1], by_contact[None], float(moment[0]), _gradient(moment))


def _gradient(values: Floats) -> Floats:
    """Compute the gradient (k, ...) of values (1 + 2 k, ...) at, ahead and behind."""
    ahead, behind = np.split(values[1:], 2)
    return np.asarray((ahead - behind) / (2 * _STEP))
