"""Fit a beam in a plane of unknown inclination to one frame.

Tip and moment sensor are constraints on its shape beside the points.
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from solver.beams.beam import S_C, BentBeam
from solver.core.least_squares import CONVERGED
from solver.fitting.frame_estimate import refitted
from solver.fitting.frame_problem import FrameProblem, frame_problem_of
from solver.fitting.neighbours import neighbours_of, with_neighbours
from solver.fitting.rigid_object import friction_sign_of, with_friction_sign
from solver.fitting.robust_fit import least_squares, robust_fit, uniform_start
from solver.instrument.arrays import Floats
from solver.instrument.measurement import Measurement
from solver.instrument.small_matrices import whitening
from solver.uniform.constraints import TIP_COLUMNS
from solver.uniform.fit import FrameFit
from solver.uniform.problem import Problem
from solver.uniform.residuals import (
    MOMENT,
    MOMENT_SIGMA,
    MOMENT_UNIT,
    RIGIDITY_SIGMA,
    STRETCH_SIGMA,
)


class SpaceFits(NamedTuple):
    """Fits of a frame from several starts, and their problem with errors of the frame's own.

    `gain` is twice the log likelihood that errors of neighbouring points gain, 0 without them.
    """

    model: FrameProblem
    fits: list[FrameFit]
    gain: float


def fits_in_space(problem: Problem, model: FrameProblem, inclinations: Floats) -> SpaceFits:
    """Fit a frame, with the tips of `problem`, from a start at each inclination [rad].

    The parameters are those of `model`, psi among them; a fit's `kept` (n,) is in the order of the
    measurement's points. Starts without a beam near the points are left out. Errors that
    neighbouring points share, and the direction of friction at a rigid object, are those of the
    best fit.
    """
    space = spatial(model, problem)
    tried = (uniform_start(problem, model, float(psi)) for psi in inclinations)
    starts = _lowest(space, [start for start in tried if start is not None])
    fits = [fit for start in starts if (fit := robust_fit(space, start))]
    gain = 0.0
    if fits:
        best = _best(fits)
        if model.rigid is not None:
            model = with_friction_sign(model, friction_sign_of(model, best.p))
            space = spatial(model, problem)
            fits = [refitted(space, fit) for fit in fits]
            best = _best(fits)
        neighbours = neighbours_of(space, best.p, best.kept)
        if neighbours is not None:
            model = with_neighbours(model, neighbours)
            space = spatial(model, problem)
            fits, gain = [refitted(space, fit) for fit in fits], neighbours.gain
    return SpaceFits(model, [_in_order(problem, fit) for fit in fits], gain)


def _best(fits: list[FrameFit]) -> FrameFit:
    return min(fits, key=lambda fit: (fit.status != CONVERGED, fit.chi2))


def problem_in_plane(psi: float, measurement: Measurement, problem: Problem) -> FrameProblem:
    """Return the problem of a frame in the plane of inclination `psi` [rad]."""
    model = frame_problem_of(measurement, problem)
    mean, index = model.mean.copy(), model.parameters["psi"]
    mean[index] = psi
    return replace(model, mean=mean, free=model.free[model.free != index])


def _lowest(space: FrameProblem, starts: list[Floats]) -> list[Floats]:
    """Fit from each start with psi held; return the fits lower than those beside them.

    Where an image hardly shows psi, the objective is a long flat valley, along which a fit creeps:
    one fit in each valley is enough. Starts are in the order of psi.
    """
    held = replace(space, free=space.free[space.free != space.parameters["psi"]])
    fits = [fit for start in starts if (fit := least_squares(held, start))]
    objectives = [np.inf, *(fit.objective for fit in fits), np.inf]
    return [
        fit.p
        for fit, before, after in zip(fits, objectives, objectives[2:], strict=False)
        if fit.objective <= min(before, after)
    ]


def _in_order(problem: Problem, fit: FrameFit) -> FrameFit:
    """Return a fit of points only, in the order of the measurement."""
    kept = np.empty(problem.points, dtype=np.bool_)
    kept[problem.order] = fit.kept[: problem.points]
    return replace(fit, kept=kept)


@dataclass(frozen=True)
class SpatialProblem(FrameProblem):
    """Points of a frame whose plane is unknown, with the tip (k, 7), k = 0 or 1, as in `Problem`.

    `moments` (m, 2) has one row if there is a moment sensor: the moment about y that one unit of
    the moment at the clamp would have, were it in that direction, and the reading, both over the
    sigma of the reading and of EI. The last 2 k + m residuals are those of tips and moment.
    """

    tips: Floats = field(default_factory=lambda: np.zeros((0, TIP_COLUMNS)))
    moments: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def residuals(self, p: Floats, residual: Floats, jacobian: Floats) -> bool:
        """Write the residuals (n + 2 k + m,), and their Jacobian by shape and pose p."""
        n = self.points.shape[1]
        of_points, by_points = np.empty(n), np.empty((len(p), n))
        exists = super().residuals(p, of_points, by_points)
        residual[:n], jacobian[:, :n] = of_points, by_points
        bent = self.bent(p) if exists else None
        if bent is not None:
            for i, tip in enumerate(self.tips):
                rows = slice(n + 2 * i, n + 2 * i + 2)
                residual[rows], jacobian[:, rows] = self._tip(p, bent, tip)
            for unit, reading in self.moments:
                row, by_row = self._moment(p, bent)
                residual[-1], jacobian[:, -1] = unit * row - reading, unit * by_row
        return exists

    def _moment(self, p: Floats, bent: BentBeam) -> tuple[float, Floats]:
        """Compute the moment about y [EI / L], -M sin(psi) of eq. (27), and its gradient (p,)."""
        psi = self.parameters["psi"]
        sine, gradient = math.sin(p[psi]), np.zeros(len(p))
        gradient[: len(bent.by_moment)] = -sine * bent.by_moment
        gradient[psi] = -bent.moment * math.cos(p[psi])
        return -sine * bent.moment, gradient

    def _tip(self, p: Floats, bent: BentBeam, tip: Floats) -> tuple[Floats, Floats]:
        """Compute the predicted less the measured image of the tip (2,), whitened; Jacobian."""
        at, size = self.parameters, len(bent.by_moment)
        dx, dy, psi = at["dx"], at["dy"], at["psi"]
        (_, theta, x_c, y_c, s_c, _), by = bent.contacts[-1], bent.by_contacts[-1]
        # The tip is where it is at rest, wherever the beam begins to bend.
        sine, cosine = math.sin(theta), math.cos(theta)
        cos_psi, sin_psi = math.cos(p[psi]), math.sin(p[psi])
        # The rim at which the beam seems to end is nearer to the clamp where the end climbs.
        rim = float(tip[6])
        straight = 1 - float(self.mean[dx]) - s_c - rim * sine * sin_psi
        by_straight = np.zeros(len(p))
        by_straight[:size] = -rim * cosine * sin_psi * by[1]
        by_straight[S_C] -= 1.0
        by_straight[psi] = -rim * sine * cos_psi
        # In the plane of deflection; the end of the beam is straight but for its bow.
        x, y = x_c + straight * cosine, y_c + straight * sine
        by_x, by_y, by_turn = cosine * by_straight, sine * by_straight, np.zeros(len(p))
        by_x[:size] += by[2] - straight * sine * by[1]
        by_y[:size] += by[3] + straight * cosine * by[1]
        tilt, softness = at["tilt"], at["softness"]
        turn = p[tilt] + p[softness] * bent.moment
        by_turn[:size] = p[softness] * bent.by_moment
        by_turn[tilt], by_turn[softness] = 1.0, bent.moment
        # Inclined by psi, turned with the clamp, and projected along the ray to plane C.
        side, height = y * cos_psi, y * sin_psi
        by_side, by_height = by_y * cos_psi, by_y * sin_psi
        by_side[psi] -= height
        by_height[psi] += side
        c, s = math.cos(turn), math.sin(turn)
        point = np.array([c * x - s * side + p[dx], s * x + c * side + p[dy]])
        by_point = np.array(
            [
                c * by_x - s * by_side - (s * x + c * side) * by_turn,
                s * by_x + c * by_side + (c * x - s * side) * by_turn,
            ]
        )
        by_point[0, dx] += 1.0
        by_point[1, dy] += 1.0
        view = self.view
        below = 1 - view[2] * height
        fraction, by_fraction = height / below, by_height / below**2
        ray = view[:2] - view[2] * point
        place = point - fraction * ray
        by_place = by_point * (1 + fraction * view[2]) - np.outer(ray, by_fraction)
        # Nearer to the camera than plane C, the rim's height looks larger.
        larger, outward = rim * view[2], view[2] * place - view[:2]
        error = place + larger * fraction * outward - tip[:2]
        by_error = by_place * (1 + larger * fraction * view[2]) + np.outer(
            larger * outward, by_fraction
        )
        whitener = tip[2:6].reshape(2, 2)
        return whitener @ error, (whitener @ by_error).T


def spatial(model: FrameProblem, problem: Problem) -> SpatialProblem:
    """Return the problem of a frame with unknown psi, with tips and moment of `problem`.

    The error of the length up to the tip is a part of the tip's, along the end of the beam; that
    of EI is a part of the moment's.
    """
    tips, known = problem.arrays.tips.copy(), problem.arrays.known
    direction = _end(model)
    for tip in tips:
        inverse = np.linalg.inv(tip[2:6].reshape(2, 2))
        stretch = known[STRETCH_SIGMA] * direction
        tip[2:6] = whitening(inverse @ inverse.T + np.outer(stretch, stretch)).ravel()
    psi = model.parameters["psi"]
    information = model.information.copy()
    if information[psi, psi] > 0:  # the marginal information of the others
        information -= np.outer(information[psi], information[psi]) / information[psi, psi]
    information[psi] = information[:, psi] = 0.0
    moments = np.zeros((0, 2))
    if known[MOMENT_SIGMA] > 0:
        sigma = math.hypot(known[MOMENT_SIGMA], known[RIGIDITY_SIGMA] * known[MOMENT])
        moments = np.array([[known[MOMENT_UNIT], known[MOMENT]]]) / sigma
    constraints = 2 * len(tips) + len(moments)
    shared = np.vstack([model.shared, np.zeros((constraints, model.shared.shape[1]))])
    return SpatialProblem(
        points=model.points,
        view=model.view,
        beam=model.beam,
        shared=shared,
        mean=model.mean,
        information=information,
        free=np.union1d(model.free, [psi]),
        lost_light=model.lost_light,
        own_errors=model.own_errors,
        tips=tips,
        moments=moments,
    )


def _end(model: FrameProblem) -> Floats:
    """Compute the direction (2,) of the beam's end in the image."""
    x, y = model.points[:2, -max(model.points.shape[1] // 20, 2) :]
    along = np.array([x[-1] - x[0], y[-1] - y[0]])
    return np.asarray(along / max(float(np.hypot(*along)), 1e-12))
