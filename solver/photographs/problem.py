"""Residuals of one photograph, with the exact Jacobian.

Lengths are in units of the beam's nominal length. The parameters are those that all photographs
share,

    rigidity, length       log of EI, and of the length that bends, over their nominal values
    down                   deviation [rad] of gravity from its stated direction
    focal, k1              log of the focal length [px], and the distortion
    softness               of the clamp, as in `beams.beam`
    clamp_shift            where the beam begins to bend, beyond the clamp, over the length
    widths, bow            of the beam, as in `beams.beam`

followed by the photograph's own,

    q, s_c, friction_ratio  of the contact, as in `beams.beam`; that of a weight is not fitted
    tilt                    of the beam in its clamp
    view                    image of the clamp, roll, scale and angles, as in `view`

The friction ratio of a weight follows from its direction.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import CONTACT, DX, DY, FRICTION_RATIO, POSE, SOFTNESS, TILT, BentBeam, Q
from solver.beams.dead_load import friction_ratio_of
from solver.beams.integrated import IntegratedBeam
from solver.beams.stretch import WIDTHS
from solver.core.least_squares import Rows
from solver.core.parameters import Parameters
from solver.fitting.beam_residuals import curve_residuals
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BOW
from solver.photographs.bent_beam import places_on, with_gradient
from solver.photographs.photo_set import PhotoLoad, Stated
from solver.photographs.view import PARAMETERS, ROLL, SCALE, U, V, images_of, places_of

# A photograph's own parameters. The view's focal length and k1 are shared.
OWN: Final = Parameters((*CONTACT, ("tilt", 1), ("view", PARAMETERS - 2)))
# Newton steps of the correction after a step of the fit. Chosen: the rest is far below a pixel.
_CORRECTIONS: Final = 3
_NO_VIEW: Final = np.zeros(3)
# Differences over the length: along the beam, and across it, whose images have a beam's width.
# Chosen: between rounding and curvature.
_ALONG: Final = 1e-6
_HALF_WIDTH: Final = 1e-3
# A beam at rest has no load, at any place.
_REST_PLACE: Final = 0.5


def shared_parameters(widths: int) -> Parameters:
    """Return the parameters that all photographs share, of a beam with `widths` coefficients."""
    single = ("rigidity", "length", "down", "focal", "k1", "softness", "clamp_shift")
    return Parameters((*((name, 1) for name in single), ("widths", widths), ("bow", BOW)))


class Bent(NamedTuple):
    """Parameters (k,) of beam and clamp as in `beams.beam`, gradient (k, p), and their shape."""

    q: Floats
    by_p: Floats
    shape: BentBeam


@dataclass(frozen=True)
class PhotoProblem:
    """Data of one photograph; pixels are relative to the principal point.

    `points` (n, 2) [px] are those of the beam, `sigmas` (n, 2) [px] the vectors of their one-sigma
    errors. `marks` (m, 4) are pixels u, v, and places x, y over the nominal length; `ticks` (t, 4)
    pixels, arc length and its sigma, over the nominal length. `tip_seen` is whether `tip` is the
    beam's; `visible` is the share of the length up to it, 1 if it is. `width_ratio` is the log of
    the beam's width [px] at its true tip over that at the clamp. `side` is 1 for a beam that bends
    towards y of Sigma_a, and -1 else. `nominal_force` [N] is EI over the square of the length,
    `down` [rad] the stated direction of gravity.
    """

    points: Floats
    sigmas: Floats
    clamp: Floats
    tip: Floats
    marks: Floats
    ticks: Floats
    tip_seen: bool
    visible: float
    width_ratio: Stated
    mark_sigma: float
    load: PhotoLoad | None
    side: int
    widths: int
    down: float
    length: float
    nominal_force: float

    @cached_property
    def parameters(self) -> Parameters:
        """Names of the shared parameters, and then of the photograph's own."""
        return shared_parameters(self.widths).followed_by(*OWN.blocks)

    @property
    def shared(self) -> int:
        """Number of shared parameters."""
        return len(self.parameters) - len(OWN)

    @cached_property
    def beam(self) -> IntegratedBeam:
        """The beam; a load acts at the axis of a beam of unknown diameter, as a dead load does."""
        return IntegratedBeam(self.widths, BOW, 0.0)

    @property
    def weight(self) -> bool:
        """Whether the load's direction is fixed in the world."""
        return self.load is not None and self.load.kind == "weight"

    def bent(self, p: Floats) -> Bent | None:
        """Return the bent beam; None if no beam has these parameters."""
        at, size = self.parameters, len(self.beam.parameters)
        load, shape = at["q"], at["widths"]
        q, by_p = np.zeros(size + POSE), np.zeros((size + POSE, len(p)))
        q[:WIDTHS] = p[load : load + WIDTHS] if self.load else (0.0, _REST_PLACE, 0.0)
        if self.load:
            by_p[range(WIDTHS), range(load, load + WIDTHS)] = 1.0
        factors = np.append(np.ones(self.widths), np.full(BOW, float(self.side)))
        q[WIDTHS:size] = factors * p[shape : self.shared]
        by_p[range(WIDTHS, size), range(shape, self.shared)] = factors
        q[size + TILT], by_p[size + TILT, at["tilt"]] = self.side * p[at["tilt"]], self.side
        for row, name in ((SOFTNESS, "softness"), (DX, "clamp_shift")):
            q[size + row], by_p[size + row, at[name]] = p[at[name]], 1.0
        if self.weight:
            across = self.side * (self.down + p[at["down"]]) - math.pi / 2
            direction = math.remainder(across, math.tau) + math.pi / 2
            friction_ratio = friction_ratio_of(self.beam, q, direction)
            if friction_ratio is None:
                return None
            by_p[FRICTION_RATIO] = 0.0
            by_p[FRICTION_RATIO] = friction_ratio.gradient @ by_p
            by_p[FRICTION_RATIO, at["down"]] += friction_ratio.by_direction * self.side
            q[FRICTION_RATIO] = friction_ratio.value
        bent = self.beam.bent(q[:size])
        return None if bent is None else Bent(q, by_p, bent)

    def rows(self, p: Floats) -> Rows | None:
        """Compute all residuals; None if no beam or no view has these parameters.

        Those of the beam's points come first, then those of `labels`.
        """
        bent = self.bent(p)
        places = places_of(self.points, p[self.view])
        if bent is None or places is None:
            return None
        k = len(bent.q) - POSE
        mirror = np.array([1.0, self.side])
        arrays = np.concatenate(
            [
                places.points * mirror,
                (places.by_pixel @ self.sigmas[:, :, None])[:, :, 0] * mirror,
            ],
            axis=1,
        )
        n = len(self.points)
        residual, jacobian = np.empty(n), np.empty((len(bent.q), n))
        shape = bent.shape
        exists = curve_residuals(
            bent.q, shape.curve, shape.moment, shape.by_moment, np.ascontiguousarray(arrays.T),
            _NO_VIEW, residual, jacobian,
        )  # fmt: skip
        if not exists:
            return None
        # As in `curve_residuals`, the Jacobian is that of points without their errors: an error
        # that scales with the view would pull the view.
        ideal = places_of(self.points - residual[:, None] * self.sigmas, p[self.view])
        if ideal is None:
            return None
        by_all = jacobian.T @ bent.by_p
        # A shift of a point is that of the clamp, reversed.
        by_place = -jacobian[[k + DX, k + DY]].T * mirror
        by_all[:, self.view] += (by_place[:, None] @ ideal.by_view)[:, 0]
        marked, width = self._marked(p, bent), self._width(p, bent)
        if marked is None or width is None:
            return None
        kept = np.ones(len(marked.residual), np.bool_)
        kept[2:4] = self.tip_seen
        marked = Rows(marked.residual[kept], marked.jacobian[:, kept])
        parts = (Rows(residual, by_all.T), marked, width, self._stated(p, bent))
        return Rows(
            np.concatenate([part.residual for part in parts]),
            np.ascontiguousarray(np.hstack([part.jacobian for part in parts])),
        )

    def moved(self, p: Floats, step: Floats) -> Floats:
        """Return the parameters (p,) after a step (p,) of a fit.

        With the view's angle the scale along the beam changes, and two points determine their
        product well and both badly. Roll, scale and place of the view are corrected so that the
        images of clamp and tip change by what the linear model predicts: the iterates then follow
        the curved valley of the objective.
        """
        moved = p + step
        placed = [self.parameters["view"] + i for i in (U, V, ROLL, SCALE)]
        before = self._ends(p)
        if before is None:
            return moved
        expected = before.residual + step @ before.jacobian
        for _ in range(_CORRECTIONS):
            ends = self._ends(moved, by_beam=False)
            matrix = None if ends is None else ends.jacobian[placed].T
            if ends is None or matrix is None or not np.linalg.det(matrix):
                return p + step
            moved[placed] -= np.linalg.solve(matrix, ends.residual - expected)
        return moved

    def _ends(self, p: Floats, *, by_beam: bool = True) -> Rows | None:
        """Compute the residuals (4,) of clamp and tip."""
        bent = self.bent(p)
        marked = None if bent is None else self._marked(p, bent, by_beam=by_beam)
        return None if marked is None else Rows(marked.residual[:4], marked.jacobian[:, :4])

    @property
    def view(self) -> list[int]:
        """Indices of the view's parameters, with the shared ones."""
        return self.parameters.indices("view", "focal", "k1")

    def force(self, p: Floats, bent: Bent) -> tuple[float, Floats]:
        """Compute the load's force [N] and its gradient (p,)."""
        (q, by_p, _), at = bent, self.parameters
        root = math.hypot(1.0, q[FRICTION_RATIO])
        force = self.nominal_force * math.exp(p[at["rigidity"]] - 2 * p[at["length"]]) * q[Q] * root
        gradient = force / root**2 * q[FRICTION_RATIO] * by_p[FRICTION_RATIO]
        gradient = gradient + force / max(q[Q], 1e-300) * by_p[Q]
        gradient[at["rigidity"]] += force
        gradient[at["length"]] -= 2 * force
        return force, gradient

    def place(self, p: Floats) -> tuple[float, Floats]:
        """Compute the load's arc length [m] from the clamp, and its gradient (p,)."""
        gradient, at = np.zeros(len(p)), self.parameters
        unit = self.length * math.exp(p[at["length"]])
        value = unit * (p[at["s_c"]] + p[at["clamp_shift"]])
        gradient[at["length"]], gradient[[at["s_c"], at["clamp_shift"]]] = value, unit
        return float(value), gradient

    @cached_property
    def labels(self) -> dict[str, int]:
        """Keys of photos.json that the residuals after those of the points are of, and how many."""
        pixels = ["clamp_px", *["tip_px"] * self.tip_seen]
        pixels += [f"ticks.{i}" for i in range(len(self.ticks))]
        pixels += [f"marks.{i}" for i in range(len(self.marks))]
        force, place = (self.load.force, self.load.place) if self.load else (None, None)
        stated = [*["load.force_n"] * bool(force), *["load.at_mm"] * bool(place)]
        return dict.fromkeys(pixels, 2) | dict.fromkeys(["width", *stated], 1)

    def _marked(self, p: Floats, bent: Bent, *, by_beam: bool = True) -> Rows | None:
        """Compute the residuals of clamp, tip, ticks and marks; by the view only if not `by_beam`.

        A hidden tip has residuals as well, against the last place that is visible.
        """
        length, shift = (self.parameters[name] for name in ("length", "clamp_shift"))
        mirror, unit = np.array([1.0, self.side]), math.exp(-p[length])
        arcs = np.append(1.0, self.ticks[:, 2] * unit - p[shift])
        used = np.asarray(bent.by_p.any(axis=1) & by_beam)
        on_beam = with_gradient(
            self.beam, bent.shape, bent.q, used, lambda shape, q: places_on(shape, q, arcs)
        )
        marks, first = self.marks[:, 2:] * unit, 1 + len(arcs)
        places = np.vstack([np.zeros(2), on_beam.value * mirror, marks])
        images = images_of(places, p[self.view])
        if images is None:
            return None
        by_all = np.zeros((*images.pixels.shape, len(p)))
        by_all[:, :, self.view] = images.by_view
        by_places = mirror[:, None] * (on_beam.gradient @ bent.by_p)
        by_all[1:first] += images.by_place[1:first] @ by_places
        # A tick moves along the beam where the length or the beam's begin changes.
        ahead = places_on(bent.shape, bent.q, arcs + _ALONG) - on_beam.value
        by_arc = (images.by_place[2:first] @ (ahead[1:] * mirror / _ALONG)[:, :, None])[:, :, 0]
        by_all[2:first, :, length] -= by_arc * self.ticks[:, 2:3] * unit
        by_all[2:first, :, shift] -= by_arc
        by_all[first:, :, length] -= (images.by_place[first:] @ marks[:, :, None])[:, :, 0]
        pixels = np.vstack([self.clamp, self.tip, self.ticks[:, :2], self.marks[:, :2]])
        residual = self._whitening @ (images.pixels - pixels)[:, :, None]
        by_all = self._whitening @ by_all
        return Rows(residual.ravel(), by_all.reshape(residual.size, -1).T)

    @cached_property
    def _whitening(self) -> Floats:
        """Matrices (m, 2, 2) from pixels to sigmas, of clamp, tip, ticks and marks."""
        chord = self.tip - self.clamp
        length = math.hypot(*chord)
        axes = np.array([chord, [-chord[1], chord[0]]]) / length
        along = np.hypot(self.mark_sigma, self.ticks[:, 3] * length / self.visible)
        whitening = np.tile(
            np.eye(2) / self.mark_sigma, (2 + len(self.ticks) + len(self.marks), 1, 1)
        )
        whitening[2 : 2 + len(along)] = axes / self.mark_sigma
        whitening[2 : 2 + len(along), 0] = axes[0] / along[:, None]
        return whitening

    def _width(self, p: Floats, bent: Bent) -> Rows | None:
        """Compute the residual of the width at the tip over that at the clamp."""
        before, tip = places_on(bent.shape, bent.q, np.array([1 - _HALF_WIDTH, 1.0]))
        half = np.array([before[1] - tip[1], self.side * (tip[0] - before[0])])
        mirror, start = np.array([1.0, self.side]), np.array([0.0, _HALF_WIDTH])
        edges = [start, -start, tip * mirror + half, tip * mirror - half]
        images = images_of(np.array(edges), p[self.view])
        if images is None:
            return None
        across = images.pixels[::2] - images.pixels[1::2]
        by_view = images.by_view[::2] - images.by_view[1::2]
        square = (across**2).sum(axis=1)
        gradient, widths = np.zeros((len(p), 1)), self.parameters.indices("widths")
        relative = (across[:, :, None] * by_view).sum(axis=1) / square[:, None]
        gradient[self.view, 0] = relative[1] - relative[0]
        # Legendre's polynomials are 1 at the tip.
        taper = 1 + p[widths].sum()
        gradient[widths, 0] += 1 / taper
        value = math.log(square[1] / square[0]) / 2 + math.log(taper)
        residual = np.array([value - self.width_ratio.value])
        return Rows(residual / self.width_ratio.sigma, gradient / self.width_ratio.sigma)

    def _stated(self, p: Floats, bent: Bent) -> Rows:
        """Compute the residuals of the stated force and place."""
        residuals: list[float] = []
        gradients: list[Floats] = []
        if self.load and self.load.force:
            _append(residuals, gradients, self.load.force, *self.force(p, bent))
        if self.load and self.load.place:
            _append(residuals, gradients, self.load.place, *self.place(p))
        return Rows(np.array(residuals), np.array(gradients).reshape(len(residuals), len(p)).T)


def _append(
    residuals: list[float], gradients: list[Floats], stated: Stated, value: float, gradient: Floats
) -> None:
    # A value that is stated as exact. Chosen: better than any balance and any ruler.
    sigma = max(stated.sigma, 1e-6 * stated.value)
    residuals.append((value - stated.value) / sigma)
    gradients.append(gradient / sigma)
