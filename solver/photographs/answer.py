"""What photographs of one beam show: loads, the beam, and what cannot be known from them."""

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from solver.beams.beam import S_C
from solver.beams.dead_load import turn_of
from solver.core.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.photographs.bent_beam import places_on, with_gradient
from solver.photographs.fit import PhotosFit, load_gain
from solver.photographs.photo_set import PhotoSet
from solver.photographs.prior import nominal_rigidity
from solver.photographs.problem import PhotoProblem
from solver.photographs.view import VIEW_A, VIEW_B

# A contact nearer to the tip than this many sigmas is at the tip. Chosen, as in `verdict`.
_TIP_SIGMAS: Final = 2.0
# Reduction of chi2 by a load that shows it. Derived: without a load, two parameters reduce it by
# more in one photograph of 270,000.
MIN_GAIN: Final = 25.0
# Factor by which the linear estimate of that reduction is larger where the load is clear. Chosen: a
# bent beam is not so far from linear.
_CLEAR: Final = 4.0


class Value(NamedTuple):
    """A value with its one-sigma error, and the share of its variance due to the view's angle."""

    value: float
    sigma: float
    view_share: float = 0.0


@dataclass(frozen=True)
class PhotoAnswer:
    """Answer for one photograph: outcome, message, and values in SI units by name.

    `chi2` is the sum of squares of the residuals of the points that were kept, in stated sigmas,
    `dof` the number of those that are independent.
    """

    outcome: Outcome
    message: str
    values: dict[str, Value] = field(default_factory=dict)
    chi2: float | None = None
    dof: int | None = None
    rejected: int | None = None


def shared_values(fit: PhotosFit, photos: PhotoSet) -> dict[str, Value]:
    """Return what all photographs share, in SI units: EI where it is known, bow, lens, clamp."""
    p, errors, at = fit.at.p, fit.covariance, fit.problem.parameters

    def value(i: int) -> Value:
        return Value(float(p[i]), math.sqrt(max(errors[i, i], 0.0)))

    def scale(name: str, nominal: float) -> Value:
        """Return what has its logarithm over a nominal value as a parameter."""
        size = nominal * math.exp(p[at[name]])
        return Value(size, size * math.sqrt(errors[at[name], at[name]]))

    values = {}
    if rigidity_known(fit, photos):
        values["flexural_rigidity_n_m2"] = scale("rigidity", nominal_rigidity(photos))
    unit = scale("length", photos.length.value)
    ends, shift = [at["length"], at["clamp_shift"]], float(p[at["clamp_shift"]])
    by_ends = unit.value * np.array([1 + shift, 1.0])
    values["length_m"] = Value(
        unit.value * (1 + shift), math.sqrt(by_ends @ errors[np.ix_(ends, ends)] @ by_ends)
    )
    values["focal_length_px"] = scale("focal", 1.0)
    values["k1"] = value(at["k1"])
    values["clamp_softness"] = value(at["softness"])
    for i, width in enumerate(at.indices("widths")):
        values[f"width_{i}"] = value(width)
    bow, length = at.span("bow"), values["length_m"].value
    # The tip's distance from the clamp's tangent, without a load.
    variance = max(float(errors[bow, bow].sum()), 0.0)
    values["bow_m"] = Value(length * float(p[bow].sum()), length * math.sqrt(variance))
    return values


def rigidity_known(fit: PhotosFit, photos: PhotoSet) -> bool:
    """Whether EI is stated, or follows from a known force."""
    return photos.rigidity is not None or fit.problem.parameters["rigidity"] in fit.problem.free


def photo_answer(fit: PhotosFit, photos: PhotoSet, photo: int) -> PhotoAnswer:
    """Return the answer for one photograph that fits."""
    own, own_fit = fit.problem.photos[photo], fit.fits[photo]
    residual = fit.at.rows[photo].residual[: len(own.points)][own_fit.kept]
    outcome, message = Outcome.NO_CONTACT, "The beam is at rest."
    values = _values(fit, photos, photo)
    if own.load:
        outcome, message = _verdict(fit, own, photo, values)
    if own.load and not outcome.has_values:
        kept = ("clamp_tilt_rad", "view_a_rad", "view_b_rad")
        values = {name: values[name] for name in kept}
    return PhotoAnswer(
        outcome=outcome,
        message=message,
        values=values,
        chi2=float(residual @ residual),
        dof=max(round(own_fit.independent), 1),
        rejected=int((~own_fit.kept).sum()),
    )


def misfit_answer(fit: PhotosFit, photo: int) -> PhotoAnswer:
    """Return the answer for one photograph that no beam with a single load fits."""
    own = fit.fits[photo]
    return PhotoAnswer(
        Outcome.INVALID,
        f"The residuals are {own.misfit / own.scale:.1f} times the expected ones, and "
        f"{(~own.kept).sum()} of {len(own.kept)} points are rejected: no beam with a single load "
        "has this shape.",
        rejected=int((~own.kept).sum()),
    )


class _Verdict(NamedTuple):
    outcome: Outcome
    message: str


def _verdict(fit: PhotosFit, own: PhotoProblem, photo: int, values: dict[str, Value]) -> _Verdict:
    """Test whether a single load is better than bow, sag, clamp, lens and view without one."""
    column = fit.problem.columns(photo)[own.parameters["q"]]
    clear = fit.at.p[column] ** 2 > _CLEAR * MIN_GAIN * fit.covariance[column, column]
    if not clear and (gain := load_gain(fit, photo)) < MIN_GAIN:
        return _Verdict(
            Outcome.NOT_IDENTIFIABLE,
            "No single load is shown: bow, own weight, clamp, lens and view explain the bend as "
            f"well (a load reduces chi2 by {max(gain, 0.0):.1f}, needed are {MIN_GAIN:g}). A "
            "photograph at rest, marks or beam_shape.bow_sigma_mm would distinguish them.",
        )
    place = values["s_c_m"]
    if place.sigma > THRESHOLDS.weak_sigma * own.length:
        outcome = Outcome.WEAK_CONTACT
    else:
        at_tip = own.length - place.value < _TIP_SIGMAS * place.sigma
        outcome = Outcome.TIP_CONTACT if at_tip else Outcome.CONTACT
    return _Verdict(outcome, outcome.sentence)


def _values(fit: PhotosFit, photos: PhotoSet, photo: int) -> dict[str, Value]:
    own, columns = fit.problem.photos[photo], fit.problem.columns(photo)
    p = fit.at.p[columns]
    errors = fit.covariance[np.ix_(columns, columns)]
    at, view = own.parameters, own.parameters["view"]
    angles = [view + VIEW_A, view + VIEW_B]
    bent = own.bent(p)
    assert bent is not None  # the fit's minimum has a shape

    def value(number: float, gradient: Floats) -> Value:
        variance = max(float(gradient @ errors @ gradient), 0.0)
        by_view = errors[angles] @ gradient
        part = float(by_view @ np.linalg.pinv(errors[np.ix_(angles, angles)]) @ by_view)
        return Value(number, math.sqrt(variance), min(part / variance, 1.0) if variance else 0.0)

    turn = turn_of(bent.shape, bent.q)
    values = {
        "clamp_tilt_rad": value(own.side * float(turn.value), own.side * turn.gradient @ bent.by_p)
    }
    for name, angle in zip(("view_a_rad", "view_b_rad"), angles, strict=True):
        values[name] = value(float(p[angle]), np.eye(len(p))[angle])
    if own.load is None:
        return values
    values["s_c_m"] = value(*own.place(p))
    unit = own.length * math.exp(p[at["length"]])
    contact = with_gradient(
        own.beam,
        bent.shape,
        bent.q,
        np.asarray(bent.by_p.any(axis=1)),
        lambda shape, q: places_on(shape, q, q[S_C : S_C + 1]),
    )
    for name, row, sign in (("x_c_m", 0, 1), ("y_c_m", 1, own.side)):
        coordinate = sign * unit * float(contact.value[0, row])
        gradient = sign * unit * contact.gradient[0, row] @ bent.by_p
        gradient[at["length"]] += coordinate
        values[name] = value(coordinate, gradient)
    force, by_force = own.force(p, bent)
    if rigidity_known(fit, photos):
        values["force_n"] = value(force, by_force)
    rigidity = own.nominal_force * own.length**2 * math.exp(p[at["rigidity"]])
    by_ratio = by_force / rigidity
    by_ratio[at["rigidity"]] = 0.0
    values["force_over_rigidity_per_m2"] = value(force / rigidity, by_ratio)
    return values
