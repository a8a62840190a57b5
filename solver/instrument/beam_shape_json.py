"""The section `beam_shape` of rig.json: how the beam differs from a uniform one."""

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.polynomial.legendre import legval

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import (
    BOW,
    CLAMP_SHIFT,
    FIRST_WIDTH,
    FRICTION_SIGMA,
    SECTION_SIGMA,
    SOFTNESS,
    SOFTNESS_SIGMA,
    TAPER_SIGMA,
    BeamShape,
    stated_shape,
)
from solver.instrument.keys import Keys
from solver.instrument.units import MILLIMETRE

# Chosen: a polynomial of more terms is not determined by a beam's images.
MAX_WIDTHS: Final = 6
# Chosen far beyond any beam that bends like one.
MAX_WIDTH: Final = 10.0
MAX_SOFTNESS: Final = 10.0
MAX_BOW: Final = 1.0
MAX_SHIFT: Final = 0.5
MAX_SKEW_RAD: Final = 1.0
MAX_SIGMA: Final = 10.0
# Arc lengths over the length at which the width must be positive. Chosen: several for each term.
_PLACES: Final = np.linspace(0.0, 1.0, 101)


def beam_shape_keys(shape: BeamShape, length: float) -> dict[str, Any]:
    """Return the keys of the shape of a beam of this length [m]: stated sigmas, or as learned."""
    keys: dict[str, Any] = {
        "section_sigma": shape.section_sigma,
        "friction_sigma": shape.friction_sigma,
        "rigidity_sigma": shape.rigidity_sigma,
        **({"rigid_objects": True} if shape.rigid_objects else {}),
    }
    if shape.bow_sigma < math.inf:
        keys["bow_sigma_mm"] = shape.bow_sigma * length / MILLIMETRE
    if shape.friction_coefficient:
        keys["friction_coefficient"] = shape.friction_coefficient
    softness, shift = shape.sigma(SOFTNESS), shape.sigma(CLAMP_SHIFT)
    if not shape.is_learned:
        keys |= {"taper_sigma": shape.taper_sigma, "clamp_softness_sigma": softness}
        return keys | ({"clamp_shift_sigma_mm": shift * length / MILLIMETRE} if shift else {})
    return keys | {
        "widths": shape.widths.tolist(),
        "clamp_softness": shape.softness,
        "clamp_shift": shape.clamp_shift,
        "skew_rad": shape.skew,
        "bow": shape.bow.tolist(),
        "covariance": shape.covariance.tolist(),
    }


def read_beam_shape(key: Keys, length: float) -> BeamShape:
    """Read the section of a beam of this length [m]; by default it is drawn wire.

    Raises InputError.
    """
    section = _sigma(key, "section_sigma", SECTION_SIGMA)
    friction = _sigma(key, "friction_sigma", FRICTION_SIGMA)
    coefficient = _sigma(key, "friction_coefficient", 0.0)
    bow_sigma = math.inf
    if key.has("beam_shape.bow_sigma_mm"):
        longest = length / MILLIMETRE
        bow_sigma = key.number("beam_shape.bow_sigma_mm", 0, longest) / longest
    rigid = key.has("beam_shape.rigid_objects") and key.flag("beam_shape.rigid_objects")
    if not key.has("beam_shape.widths"):
        taper = _sigma(key, "taper_sigma", TAPER_SIGMA)
        softness = _sigma(key, "clamp_softness_sigma", SOFTNESS_SIGMA)
        shift = 0.0
        if key.has("beam_shape.clamp_shift_sigma_mm"):
            longest = MAX_SHIFT * length / MILLIMETRE
            shift = key.number("beam_shape.clamp_shift_sigma_mm", 0, longest) * MILLIMETRE / length
        stated = stated_shape(taper, softness, section, friction, shift, rigid, bow_sigma)
        rigidity = _sigma(key, "rigidity_sigma", stated.rigidity_sigma)
        return replace(stated, rigidity_sigma=rigidity, friction_coefficient=coefficient)
    widths = key.numbers("beam_shape.widths", -MAX_WIDTH, MAX_WIDTH, MAX_WIDTHS)
    if len(widths) and (1 + _PLACES * legval(2 * _PLACES - 1, widths) <= 0).any():
        key.refuse("beam_shape.widths", "a width that is positive along the whole beam")
    softness = key.number("beam_shape.clamp_softness", -MAX_SOFTNESS, MAX_SOFTNESS)
    shift = key.number("beam_shape.clamp_shift", -MAX_SHIFT, MAX_SHIFT)
    skew = key.number("beam_shape.skew_rad", -MAX_SKEW_RAD, MAX_SKEW_RAD)
    bow = key.numbers("beam_shape.bow", -MAX_BOW, MAX_BOW, BOW)
    if len(bow) not in (0, BOW):
        key.refuse("beam_shape.bow", f"a list of none or {BOW} numbers")
    covariance = _covariance(key, FIRST_WIDTH + len(widths) + len(bow))
    rigidity = _sigma(key, "rigidity_sigma", 0.0)
    return BeamShape(
        widths=widths,
        softness=softness,
        clamp_shift=shift,
        skew=skew,
        bow=bow,
        covariance=covariance,
        section_sigma=section,
        rigidity_sigma=rigidity,
        friction_sigma=friction,
        rigid_objects=rigid,
        friction_coefficient=coefficient,
        bow_sigma=bow_sigma,
    )


def _sigma(key: Keys, name: str, default: float) -> float:
    name = f"beam_shape.{name}"
    return key.number(name, 0, MAX_SIGMA) if key.has(name) else default


def _covariance(key: Keys, size: int) -> Floats:
    name, limit = "beam_shape.covariance", MAX_SIGMA**2
    matrix = key.matrix(name, -limit, limit, size)
    # Twelve digits are written: sums of them may be negative by their rounding.
    if not np.array_equal(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] < -1e-9 * limit:
        key.refuse(name, "a symmetric matrix without negative eigenvalues")
    return matrix
