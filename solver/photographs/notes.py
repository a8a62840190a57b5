"""Sentences on what cannot be known from photographs."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from solver.instrument.units import DEGREE, PERCENT
from solver.photographs.answer import PhotoAnswer, rigidity_known
from solver.photographs.fit import PhotosFit
from solver.photographs.photo_set import PhotoSet

# A parameter whose sigma is above this fraction of its prior's is that of the prior. Chosen.
_UNDETERMINED: Final = 0.9
# Marks that determine the view of a plane. Derived: it has eight unknown numbers.
_MARKS: Final = 4

TESTED: Final = (
    "These sigmas were tested in rendered photographs, and in one set of real ones only: compare a "
    "force with a known one, such as a weighed mass, before you trust the others."
)


def notes_of(fit: PhotosFit, photos: PhotoSet, answers: Sequence[PhotoAnswer]) -> list[str]:
    """Return the sentences; `photos` and `answers` are those of the joint fit."""
    return [
        *_of_forces(fit, photos),
        *_of_views(photos, answers),
        *_of_shared(fit, photos),
        TESTED,
    ]


def _of_forces(fit: PhotosFit, photos: PhotoSet) -> list[str]:
    loads = [photo.load for photo in photos.photographs if photo.load]
    if not loads or any(load.force for load in loads):
        return []
    if not rigidity_known(fit, photos):
        return [
            "No force is known and EI is not stated: only force_over_rigidity_per_mm2 follows, the "
            "ratios of the forces. One known force, such as a weighed mass, gives all of them."
        ]
    rigidity = fit.problem.parameters["rigidity"]
    sigma = math.sqrt(fit.covariance[rigidity, rigidity]) / PERCENT
    return [
        f"No force is known: all forces share the relative error of the stated EI, {sigma:.2g} %. "
        "One known force, such as a weighed mass, gives EI."
    ]


def _of_views(photos: PhotoSet, answers: Sequence[PhotoAnswer]) -> list[str]:
    few = [
        (photo, answer)
        for photo, answer in zip(photos.photographs, answers, strict=True)
        if photo.load and len(photo.marks) < _MARKS
    ]
    sentences = []
    if few:
        shares = [
            answer.values["s_c_m"].view_share for _, answer in few if "s_c_m" in answer.values
        ]
        share = 100 * max(shares, default=0.0)
        sentences.append(
            f"{len(few)} photographs with a load have fewer than {_MARKS} marks: the angle of "
            f"their view is an assumption of 0 +- {photos.view_sigma / DEGREE:g} degrees, and up "
            f"to {share:.0f} % of the variance of a load's place is due to it. Four marks of known "
            "position around the beam would determine it."
        )
    if any(photo.load and not len(photo.marks) for photo in photos.photographs):
        sentences.append(
            "Without marks the rotation of the beam in its clamp cannot be distinguished from a "
            f"rotation of the camera: 0 +- {photos.tilt_sigma / DEGREE:g} degrees are assumed."
        )
    return sentences


def _of_shared(fit: PhotosFit, photos: PhotoSet) -> list[str]:
    at = fit.problem.parameters
    names = {
        at["focal"]: "focal length",
        at["k1"]: "lens distortion k1",
        at["softness"]: "softness of the clamp",
        at["clamp_shift"]: "place where the beam begins to bend",
    }
    names |= {width: f"width coefficient {i}" for i, width in enumerate(at.indices("widths"))}
    sigmas = np.sqrt(np.diag(fit.covariance))
    assumed = [name for i, name in names.items() if 0 < fit.prior[i] < sigmas[i] / _UNDETERMINED]
    sentences = []
    if assumed:
        sentences.append(
            f"These photographs do not determine: {', '.join(assumed)}. What is stated or assumed "
            "about it is a part of all sigmas."
        )
    if all(photo.load for photo in photos.photographs) and not len(photos.shape.bow):
        sentences.append(
            "No photograph shows the beam at rest: bow and sag are an assumption "
            "(beam_shape.bow_sigma_mm), and a part of every load's bending."
        )
    return sentences
