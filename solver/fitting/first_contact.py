"""Has the beam touched anything? Detection of first contact."""

from dataclasses import dataclass

import numpy as np

from solver.beam_models import linear
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement

# A bend is believed from this many of its own sigmas on.
LEAST_SIGNIFICANCE = 5.0


@dataclass(frozen=True)
class Bend:
    """The nearest linear beam: x_c [m], f / (6 EI) [1/m^2], and the latter over its sigma."""

    x_c: float
    amplitude: float
    significance: float


def nearest_linear_bend(measurement: Measurement) -> Bend:
    """Over a grid of contact distances, the amplitude by least squares, of either sign."""
    x, y = measurement.points.T
    distances = measurement.rig.beam.length * np.linspace(0.02, 1.0, 50)
    shapes = linear.unit_deflection(x[:, None], distances)
    norm = (shapes**2).sum(axis=0)
    amplitude = (shapes * y[:, None]).sum(axis=0) / norm
    misfit = ((y[:, None] - amplitude * shapes) ** 2).sum(axis=0)
    best = int(np.argmin(misfit))
    # The points' own errors, and the clamp's offset and tilt, which move all points together.
    weights = shapes[:, best] / norm[best]
    sigma = np.linalg.norm(measurement.sigma_vectors, axis=1)
    by_base = np.array([weights.sum(), weights @ x])
    variance = (weights**2) @ sigma**2 + by_base @ measurement.base_covariance[1:, 1:] @ by_base
    significance = float(amplitude[best] / np.sqrt(variance))
    return Bend(float(distances[best]), float(amplitude[best]), significance)


def no_contact(bend: Bend) -> Estimate | None:
    """The answer where there is no bend, or one to the side without object; None where there is."""
    if abs(bend.significance) < LEAST_SIGNIFICANCE:
        return Estimate(Outcome.NO_CONTACT, f"a bend of {abs(bend.significance):.1f} sigmas")
    if bend.significance < 0:
        return Estimate(Outcome.INVALID, "the beam bends to the side where the rig has no object")
    return None
