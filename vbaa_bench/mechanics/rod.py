"""Statics of a Kirchhoff rod in space: the shape of a beam under given forces.

With r' = (1 + e) d3, d_i' = u x d_i, m' = -r' x n (Antman 2005, ch. VIII), n the force and m
the moment that the part ahead exerts on the part behind, the curvatures u about the section's
axes d1, d2, d3 are m.d1 / B1, m.d2 / B2, m.d3 / C plus those of the unloaded beam, and
e = n.d3 / EA. The force n follows from equilibrium alone: it is the sum of all forces ahead.
The equations are integrated from the clamp by Dormand and Prince's method of order 8 in even
steps.

Inside the numerical functions lengths are in units of L, forces in units of EI / L^2, both of
the clamped section.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.integrate import DOP853

from solver.instrument.arrays import Floats, copy_into
from solver.instrument.beam import Beam
from solver.instrument.compiled import njit
from solver.instrument.transforms import rigid

POISSON = 0.3  # of steel; used only for a beam that twists
STEPS = 32
# Tip ratio below which more steps are taken, in proportion. Measured: up to contacts at 0.92 L the
# truncation is below 1e-9 of the displacement; with two thirds of the steps it is 6e-9.
_THIN_TIP = 0.3
ORDER = 8

# The twelve stages of the tableau; `advance` skips entries that are zero.
_A = np.ascontiguousarray(DOP853.A[:12, :12])
_B = np.ascontiguousarray(DOP853.B)

# A rod's state along its length: position, first director, tangent, moment.
_SIZE = 12


@dataclass(frozen=True)
class Rod:
    """Beam with options beyond a round, straight, weightless one.

    `aspect_ratio` is the section's second semi-axis over its first. The first, half the beam's
    diameter at the clamp, is inclined by `section_angle` [rad] from y towards z, and the beam's
    flexural rigidity is that of bending along it. The section's size changes linearly to
    `tip_ratio` of the clamp's at the tip. `weight` (3,) [N/m] acts on every metre of the clamped
    section, in the world; `bow` (2,) [1/m] is the unloaded beam's curvature towards y and
    z; an `extensible` beam stretches under its axial force. The clamp turns by `clamp_softness`
    under a bending moment, in units of L / EI.
    """

    beam: Beam
    shape: Literal["ellipse", "rectangle"] = "ellipse"
    aspect_ratio: float = 1.0
    section_angle: float = 0.0
    tip_ratio: float = 1.0
    weight: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bow: tuple[float, float] = (0.0, 0.0)
    extensible: bool = False
    clamp_softness: float = 0.0

    @property
    def plain(self) -> bool:
        """Whether all options have their defaults: the beam of the planar fast path."""
        return self == Rod(self.beam, section_angle=self.section_angle)

    @property
    def steps(self) -> int:
        """Number of integration steps of the whole beam; a thinner tip needs more."""
        return max(STEPS, math.ceil(STEPS * _THIN_TIP / self.tip_ratio))

    @property
    def loose_tip(self) -> bool:
        """Whether the beam is thinnest at its tip, and unloaded ahead of all contacts."""
        return self.tip_ratio < 1 and not any(self.weight)

    @property
    def oriented(self) -> bool:
        """Whether the section has a visible orientation."""
        return self.shape == "rectangle" or self.aspect_ratio != 1

    @property
    def force_unit(self) -> float:
        """Unit of force, EI / L^2 [N]."""
        return self.beam.flexural_rigidity / self.beam.length**2

    def half_height(self, s: float) -> float:
        """Compute the semi-axis [m] of the section along its first axis, at arc length `s` [m]."""
        return self.beam.radius * (1 + (self.tip_ratio - 1) * s / self.beam.length)

    def reach(self, s: float, towards: float) -> float:
        """Compute the distance [m] from the straight centreline at `s` [m] to a tangent plane.

        The plane's normal is inclined by `towards` [rad] from y to z. A rectangle is touched on
        its face.
        """
        lean = towards - self.section_angle
        wide = self.aspect_ratio * np.sin(lean) if self.shape == "ellipse" else 0.0
        tall = np.cos(lean) if self.shape == "ellipse" else 1.0
        return float(self.half_height(s) * np.hypot(tall, wide))

    def properties(self, turned: Floats) -> Floats:
        """Compute the parameters (10,) of `advance`, in its units, with the world `turned` (3, 3).

        They are the compliances of bending about the first and the second axis, of twisting and
        of stretching; taper; weight (3,); curvature about the first and the second axis.
        """
        length, aspect_ratio = self.beam.length, self.aspect_ratio
        slim = self.beam.radius / length
        if self.shape == "ellipse":
            torsion, area = 4 * aspect_ratio**2 / (1 + aspect_ratio**2), 4 / slim**2
        else:  # Timoshenko and Goodier (1970), section 109, to 0.5 %
            torsion, area = (
                4 * (1 - 0.63 / aspect_ratio * (1 - 1 / (12 * aspect_ratio**4))),
                3 / slim**2,
            )
        cosine, sine = np.cos(self.section_angle), np.sin(self.section_angle)
        towards_y, towards_z = self.bow
        # Turning about d2 bends towards d1, turning about d1 away from d2.
        along_1 = (towards_y * cosine + towards_z * sine) * length
        along_2 = (-towards_y * sine + towards_z * cosine) * length
        return np.array(
            [
                1 / aspect_ratio**2,
                1.0,
                2 * (1 + POISSON) / torsion,
                1 / area if self.extensible else 0.0,
                self.tip_ratio - 1,
                *(turned @ np.array(self.weight) * length / self.force_unit),
                -along_2,
                along_1,
            ]
        )

    def total_weight(self, turned: Floats) -> Floats:
        """Compute the beam's weight (3,) in its units, with the world `turned` (3, 3)."""
        c = self.tip_ratio - 1
        weight = turned @ np.array(self.weight) * self.beam.length / self.force_unit
        return np.asarray(weight * (1 + c + c * c / 3))

    def weight_moment(self, turned: Floats) -> Floats:
        """Estimate the clamp's moment (3,) under the weight, as if the beam were straight and even.

        It is in the beam's units, with the world `turned` (3, 3).
        """
        return np.cross([0.5, 0.0, 0.0], self.total_weight(turned))

    def largest_strain(self, rows: Floats, states: Floats) -> float:
        """Compute the largest bending strain of any fibre over `states` (n, 12)."""
        first, tangent, moment = states[:, 3:6], states[:, 6:9], states[:, 9:]
        size = 1 + (self.tip_ratio - 1) * rows
        half = self.beam.radius / self.beam.length * size
        bend_1 = (moment * np.cross(tangent, first)).sum(axis=1) / size**4 * half
        bend_2 = (
            (moment * first).sum(axis=1) / size**4 / self.aspect_ratio**2 * half * self.aspect_ratio
        )
        if self.shape == "rectangle":
            return float((np.abs(bend_1) + np.abs(bend_2)).max())
        return float(np.hypot(bend_1, bend_2).max())

    def clamp(self, moment: Floats) -> Floats:
        """Return the state (12,) at the clamp, under a moment (3,); a soft clamp has turned."""
        state = np.zeros(_SIZE)
        state[3:6] = 0.0, np.cos(self.section_angle), np.sin(self.section_angle)
        state[6] = 1.0
        if self.clamp_softness:
            turn = rigid(self.clamp_softness * moment * [0.0, 1.0, 1.0], np.zeros(3))[:3, :3]
            state[3:6], state[6:9] = turn @ state[3:6], turn @ state[6:9]
        state[9:] = moment
        return state


@njit
def _derivative(s: float, y: Floats, ahead: Floats, p: Floats, out: Floats) -> None:
    """Fill in the state's derivative by arc length; `ahead` (3,) is the sum of forces ahead."""
    c = p[4]
    size = 1 + c * s
    # Weight of the part ahead: the integral of (1 + c s)^2.
    tail = (1 - s) + c * (1 - s * s) + c * c * (1 - s * s * s) / 3
    n_x, n_y, n_z = ahead[0] + p[5] * tail, ahead[1] + p[6] * tail, ahead[2] + p[7] * tail
    a_x, a_y, a_z = y[3], y[4], y[5]
    t_x, t_y, t_z = y[6], y[7], y[8]
    b_x, b_y, b_z = t_y * a_z - t_z * a_y, t_z * a_x - t_x * a_z, t_x * a_y - t_y * a_x
    m_x, m_y, m_z = y[9], y[10], y[11]
    soft = 1 / (size * size * size * size)
    u1 = p[8] + p[0] * soft * (m_x * a_x + m_y * a_y + m_z * a_z)
    u2 = p[9] + p[1] * soft * (m_x * b_x + m_y * b_y + m_z * b_z)
    u3 = p[2] * soft * (m_x * t_x + m_y * t_y + m_z * t_z)
    stretch = 1 + p[3] / (size * size) * (n_x * t_x + n_y * t_y + n_z * t_z)
    out[0], out[1], out[2] = stretch * t_x, stretch * t_y, stretch * t_z
    # d1' = u3 d2 - u2 d3,  d3' = u2 d1 - u1 d2
    out[3], out[4], out[5] = u3 * b_x - u2 * t_x, u3 * b_y - u2 * t_y, u3 * b_z - u2 * t_z
    out[6], out[7], out[8] = u2 * a_x - u1 * b_x, u2 * a_y - u1 * b_y, u2 * a_z - u1 * b_z
    out[9] = -stretch * (t_y * n_z - t_z * n_y)
    out[10] = -stretch * (t_z * n_x - t_x * n_z)
    out[11] = -stretch * (t_x * n_y - t_y * n_x)


@njit
def advance(y: Floats, start: float, end: float, steps: int, ahead: Floats, p: Floats) -> Floats:
    """Integrate the state (12,) from arc length `start` to `end` in even steps of order 8."""
    h = (end - start) / steps
    k = np.empty((12, _SIZE))
    y = y.copy()
    stage_state = np.empty(_SIZE)
    for step in range(steps):
        s = start + step * h
        _derivative(s, y, ahead, p, k[0])
        for i in range(1, 12):
            c = 0.0
            for q in range(_SIZE):
                stage_state[q] = y[q]
            for j in range(i):
                a = _A[i, j]
                c += a
                if a != 0.0:
                    for q in range(_SIZE):
                        stage_state[q] += h * a * k[j, q]
            _derivative(s + c * h, stage_state, ahead, p, k[i])
        for i in range(12):
            b = h * _B[i]
            for q in range(_SIZE):
                y[q] += b * k[i, q]
    return y


@njit
def trace(
    clamp: Floats,
    stops: Floats,
    forces: Floats,
    couples: Floats,
    rows: Floats,
    p: Floats,
    steps: int,
) -> Floats:
    """Compute states (n, 12) at the arc lengths `rows` (n,), which increase and hold every stop.

    `steps` is the number of integration steps from row to row.
    """
    ahead = np.zeros(3)
    for i in range(len(stops)):
        for axis in range(3):
            ahead[axis] += forces[i, axis]
    states = np.empty((len(rows), _SIZE))
    state, position, passed = clamp, 0.0, 0
    for i in range(len(rows)):
        if rows[i] > position:
            state = advance(state, position, rows[i], steps, ahead, p)
            position = rows[i]
        copy_into(states[i], state)
        while passed < len(stops) and rows[i] >= stops[passed]:
            for axis in range(3):
                state[9 + axis] -= couples[passed, axis]
                ahead[axis] -= forces[passed, axis]
            passed += 1
    return states


def cross(a: Floats, b: Floats) -> Floats:
    """Return the product a x b (3,); `np.cross` takes 30 times as long for two vectors."""
    (a_x, a_y, a_z), (b_x, b_y, b_z) = a.tolist(), b.tolist()
    return np.array([a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x])
