"""Bias and spread of the simple model where a frame breaks its assumptions.

The simple model is a uniform beam with one contact without friction. Maximum likelihood with it
converges to the parameters whose image is nearest to the true one, in the metric of the information
(White 1982). Their difference from the true ones is the bias that no method with this model avoids,
and their covariance is A^-1 B A^-1, with the information B and the curvature A of the likelihood
(Richmond and Horowitz 2015; Fortunati, Gini and Gini 2017, eq. 15).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.frame_limits import FrameLimits
from vbaa_bench.limits.image_shape import (
    APPEARANCE,
    ImageShape,
    PlacesInformation,
    image_information,
    image_shape,
)
from vbaa_bench.limits.imaged_beam import (
    BEAM,
    CONTACT,
    FRACTIONS,
    FRICTION,
    SECOND_CONTACT,
    SHAPE,
    ImagedBeam,
    Neighbours,
)
from vbaa_bench.limits.information import Information, pseudo_inverse
from vbaa_bench.limits.profile import SHIFT
from vbaa_bench.limits.quantities import QUANTITIES, SECOND, difference, gradients
from vbaa_bench.mechanics.loaded import Load
from vbaa_bench.mechanics.state import EquilibriumError, interpolated

# Most steps of Gauss and Newton, and the longest one relative to the natural units. Chosen: from
# the true parameters, ten steps reach any others that a beam may have.
_STEPS: Final = 40
_LONGEST: Final = 0.1
# A step this small, in natural units, ends the fit. Chosen: a thousandth of the errors of derived
# limits.
_CONVERGED: Final = 1e-7
_BENDING: Final = {*CONTACT, *BEAM}
# It has one contact: QUANTITIES without those of a second one.
_COUNT: Final = len(QUANTITIES) - len(SECOND)


class SimpleModel(NamedTuple):
    """Bias (4,) of the first QUANTITIES, and their standard deviations (4,) about it."""

    bias: Floats
    sigmas: Floats


@dataclass(frozen=True)
class SimpleFit:
    """Fit of the simple model to the expected image of a frame; with `planar`, psi is known."""

    frame: FrameLimits
    planar: bool

    @property
    def is_needed(self) -> bool:
        """Whether the frame breaks an assumption of the simple model."""
        several = len(self.frame.imaged.loads) > 1
        return several or any(self.frame.rubbing) or self.frame.rig.scene.beam.tip_ratio != 1

    def result(self) -> SimpleModel:
        """Fit the model. Raises EquilibriumError."""
        fitted, names = self._fitted, self._names
        information = self._information(fitted)
        inverse = pseudo_inverse(self._curvature(fitted, information))
        covariance = inverse @ information @ inverse
        at_rest = self.frame.contact_at_rest
        bending = {name: one for name, one in fitted.neighbours.items() if name in _BENDING}
        of_bending = gradients(bending, at_rest).quantities[:_COUNT]
        rows = np.zeros((len(of_bending), len(names)))
        rows[:, [names.index(name) for name in bending]] = of_bending
        variance = np.einsum("qi,ij,qj->q", rows, covariance, rows)
        bias = difference(fitted.imaged, self.frame.imaged, at_rest)[: len(variance)]
        return SimpleModel(bias, np.sqrt(variance))

    @cached_property
    def _fitted(self) -> "_Fit":
        """Parameters at which the expected score vanishes, by Gauss's and Newton's steps."""
        true = self.frame.imaged
        rod = replace(true.rod, tip_ratio=1.0, bow=(0.0, 0.0))
        first = true.loads[0]
        load = Load(first.s, first.normal_force, first.direction)
        start = replace(true, rod=rod, loads=(load,), shape=None)
        fit = _Fit(start, dict.fromkeys(self._names, 0.0))
        units = np.array([start.unit(name) for name in self._names])
        for _ in range(_STEPS):
            step = pseudo_inverse(self._information(fit)) @ self._score(fit)
            largest = np.abs(step / units).max()
            fit = fit.moved(step / max(1.0, largest / _LONGEST))
            if largest < _CONVERGED:
                return fit
        raise EquilibriumError("the simple model does not fit this image")

    def _score(self, fit: "_Fit") -> Floats:
        """Compute the expected derivative (p,) of the likelihood with respect to the parameters."""
        residual, at_tip = _residuals(fit.shape, fit.imaged, self.frame.imaged)
        weights = fit.shape.steps * self._places.of_length[:, SHIFT, SHIFT]
        of_image = fit.shape.across @ (weights * residual)
        of_image += self._places.of_tip * at_tip * fit.shape.tip_along
        return np.asarray(of_image - self._before @ list(fit.moves.values()))

    def _curvature(self, fit: "_Fit", information: Floats) -> Floats:
        """Compute minus the derivative (p, p) of the score.

        Beside the information it has second derivatives of the image times residuals. Those by the
        beam's bend are computed; an image is nearly linear in the other parameters.
        """
        residual, at_tip = _residuals(fit.shape, fit.imaged, self.frame.imaged)
        weighted = fit.shape.steps * self._places.of_length[:, SHIFT, SHIFT] * residual
        bends = [row for row, name in enumerate(self._names) if name in _BENDING]
        others = [row for row in range(len(self._names)) if row not in bends]
        second = np.zeros_like(information)
        for row in bends:
            one = fit.neighbours[self._names[row]]
            behind, ahead = (_Fit(beam, fit.moves).shape for beam in (one.behind, one.ahead))
            change = (ahead.across - behind.across) @ weighted
            change += self._places.of_tip * at_tip * (ahead.tip_along - behind.tip_along)
            second[row] = change / one.difference
        second[np.ix_(others, bends)] = second[np.ix_(bends, others)].T
        return information - (second + second.T) / 2

    def _information(self, fit: "_Fit") -> Floats:
        """Compute the information (p, p) of the image and of all data before it."""
        of_image = image_information(fit.shape, self._places).eliminated(APPEARANCE)
        return of_image.matrix + self._before

    @cached_property
    def _names(self) -> tuple[str, ...]:
        frame = self.frame
        names = (*frame.parameters, *frame.rig.parameters(frame.imaged.camera))
        unmodelled = {*FRICTION, *SECOND_CONTACT, *SHAPE} | ({CONTACT[2]} if self.planar else set())
        return tuple(name for name in names if name not in unmodelled)

    @cached_property
    def _before(self) -> Floats:
        """Information (p, p) of the data before contact, on which the model agrees."""
        rig = self.frame.rig
        before = (rig.before_contact + self.frame.stated).without(rig.known | {*SHAPE, *FRICTION})
        before = before.eliminated(set(before.names) - set(self._names))
        empty = Information(self._names, np.zeros((len(self._names),) * 2))
        return (empty + before).matrix

    @cached_property
    def _places(self) -> PlacesInformation:
        frame = self.frame
        pose = frame.pose
        return frame.rig.of_places(frame.imaged, pose.state, frame.visible, pose.spec.scene)


@dataclass(frozen=True)
class _Fit:
    """Parameters of the simple model: its beam, and how far each has moved."""

    imaged: ImagedBeam
    moves: dict[str, float]

    @cached_property
    def neighbours(self) -> dict[str, Neighbours]:
        return self.imaged.neighbours(tuple(self.moves))

    @cached_property
    def shape(self) -> ImageShape:
        return image_shape(self.imaged, self.neighbours)

    def moved(self, step: Floats) -> "_Fit":
        imaged, moves = self.imaged, {}
        for (name, move), change in zip(self.moves.items(), step, strict=True):
            imaged = imaged.changed(name, float(change))
            moves[name] = move + float(change)
        return _Fit(imaged, moves)


def _residuals(shape: ImageShape, model: ImagedBeam, true: ImagedBeam) -> tuple[Floats, float]:
    """Compute the true line's distance (n,) [px] across the model's, and its end's along it."""
    line, target = model.pixels, true.pixels
    tangents = np.gradient(line, FRACTIONS, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    along_target = np.gradient(target, FRACTIONS, axis=0)
    at = FRACTIONS.copy()
    for _ in range(3):  # the place on the true line that is across the model's place
        points, slopes = (interpolated(at, FRACTIONS, rows) for rows in (target, along_target))
        gap = ((points - line) * tangents).sum(axis=1)
        at = at - gap / (slopes * tangents).sum(axis=1)
    # Beyond its ends the true line is straight.
    beyond = at - np.clip(at, 0.0, 1.0)
    points = interpolated(at, FRACTIONS, target)
    points += beyond[:, None] * slopes
    across = ((points - line)[1:-1] * shape.normals).sum(axis=1)
    return across, float((target[-1] - line[-1]) @ tangents[-1])
