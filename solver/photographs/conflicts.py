"""Find stated and assumed values that the photographs contradict."""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.units import DEGREE, MILLIMETRE
from solver.photographs.fit import PhotosFit
from solver.photographs.photo_set import PhotoSet
from solver.photographs.prior import nominal_rigidity
from solver.photographs.problem import OWN
from solver.photographs.view import VIEW_A, VIEW_B

# Sigmas from which a value is contradicted. Derived: one set in 150 with a hundred values that are
# right has a larger difference.
MAX_SIGMAS: Final = 4.0
# Least variance of the difference, over that of the prior. Chosen: where the photographs hardly
# determine a value, the difference is what the linear covariance leaves out.
_LEAST_SHARE: Final = 0.5
_WIDTH: Final = "the width along the beam (beam_shape.taper_sigma, camera.view_sigma_deg)"
_SQUARE_MILLIMETRE: Final = MILLIMETRE**2


class Conflict(NamedTuple):
    """A contradicted value: its key, how many sigmas it is off, and a sentence.

    `photo` is the index of the photograph of which it is stated, None if all share it.
    """

    key: str
    sigmas: float
    sentence: str
    photo: int | None = None

    @property
    def of_load(self) -> bool:
        """Whether it is the force or the place of a load."""
        return self.key.startswith("load.")


class _Named(NamedTuple):
    """Column of a parameter, its photograph or None, its key, and its value in the key's unit."""

    column: int
    photo: int | None
    key: str
    of: Callable[[float], float]


def worst_conflict(fit: PhotosFit, photos: PhotoSet) -> Conflict | None:
    """Return the value that is contradicted most, None if there is none.

    A value of one photograph comes before those that all share, which it may pull.
    """
    every = [*_of_parameters(fit, photos), *_of_residuals(fit)]
    conflicts = [one for one in every if one.sigmas > MAX_SIGMAS]
    own = [one for one in conflicts if one.photo is not None]
    return max(own or conflicts, key=lambda one: one.sigmas, default=None)


def _of_parameters(fit: PhotosFit, photos: PhotoSet) -> list[Conflict]:
    """Compare parameters with their priors.

    The difference has the variance of the prior, less that of the fit.
    """
    conflicts = []
    for column, photo, key, of in _named(fit, photos):
        prior, mean, value = fit.prior[column], fit.problem.mean[column], float(fit.at.p[column])
        if not 0 < prior < math.inf:
            continue
        variance = float(fit.covariance[column, column])
        off = abs(value - mean) / math.sqrt(max(prior**2 - variance, _LEAST_SHARE * prior**2))
        stated, fitted = (
            f"{of(at):.4g} +- {abs(of(at + sigma) - of(at)):.2g}"
            for at, sigma in ((mean, prior), (value, math.sqrt(variance)))
        )
        sentence = (
            f"{key} is {stated}, as stated or assumed, but {fitted} in the photographs: "
            f"{off:.0f} sigmas off. Correct it, or what is stated of the loads."
        )
        conflicts.append(Conflict(key, off, sentence, photo))
    return conflicts


def _named(fit: PhotosFit, photos: PhotoSet) -> list[_Named]:
    """Name the parameters of which something is stated or assumed."""
    at, length_mm = fit.problem.parameters, photos.length.value / MILLIMETRE
    rigidity = nominal_rigidity(photos) / _SQUARE_MILLIMETRE
    shared: dict[str, tuple[str, Callable[[float], float]]] = {
        "rigidity": ("beam.flexural_rigidity_n_mm2", lambda p: rigidity * math.exp(p)),
        "length": ("beam.length_mm", lambda p: length_mm * math.exp(p)),
        "down": ("down_deg", lambda p: (photos.down.value + p) / DEGREE),
        "focal": ("camera.focal_length_px", math.exp),
        "k1": ("camera.k1", float),
        "softness": ("the clamp's softness (beam_shape.clamp_softness_sigma)", float),
        "clamp_shift": ("beam_shape.clamp_shift_sigma_mm", lambda p: length_mm * p),
        "widths": ("the taper (beam_shape.taper_sigma)", float),
        "bow": (
            "a coefficient of the bow in mm (beam_shape.bow_sigma_mm)",
            lambda p: length_mm * p,
        ),
    }
    named = [
        _Named(i, None, key, of) for name, (key, of) in shared.items() for i in at.indices(name)
    ]
    own = {
        OWN["tilt"]: "the rotation in the clamp (clamp_tilt_sigma_deg)",
        OWN["view"] + VIEW_A: "the first angle of the view (camera.view_sigma_deg)",
        OWN["view"] + VIEW_B: "the second angle of the view (camera.view_sigma_deg)",
    }
    for photo in range(len(fit.problem.photos)):
        columns = fit.problem.columns(photo)[len(at) :]
        named += [_Named(columns[i], photo, key, lambda p: p / DEGREE) for i, key in own.items()]
    return named


def _of_residuals(fit: PhotosFit) -> list[Conflict]:
    """Compare clamp, tip, marks, width, force and place of each photograph with the fit."""
    conflicts = []
    for i, (rows, problem) in enumerate(zip(fit.at.rows, fit.problem.photos, strict=True)):
        ends = np.cumsum([len(problem.points), *problem.labels.values()]).tolist()
        for label, first, last in zip(problem.labels, ends[:-1], ends[1:], strict=True):
            sigmas = float(np.linalg.norm(rows.residual[first:last]))
            name = _WIDTH if label == "width" else label
            sentence = f"{name} is {sigmas:.0f} sigmas from what the photographs show."
            conflicts.append(Conflict(label, sigmas, sentence, i))
    return conflicts
