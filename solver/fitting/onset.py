"""The motor's angle at first contact, from how the deflection grows in a push.

Before contact the beam is straight; afterwards its amplitude grows with the motor's angle, nearly
in proportion at first. The onset is where that growth, carried back, begins. It is found from all
frames together, also where none was taken before contact, and is far sharper than the first frame
in which a bend is significant.
"""

import math
from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats

LEAST_FRAMES = 2
LEAST_SIGNIFICANCE = 5.0
# Relative growth of the slope per radian that the exact beam shows in a push, one sigma.
CURVATURE_SIGMA = 1.0
CLOSING_IN = 4


@dataclass(frozen=True)
class Onset:
    """Motor angle at first contact [rad] and its sigma, and the growth beyond [amplitude/rad].

    `growth` is negative where the motor turns towards smaller angles. `chi2` on `dof` tells whether
    one push with one onset explains the amplitudes.
    """

    angle: float
    sigma: float
    growth: float
    chi2: float
    dof: int


def onset(angles: Floats, amplitudes: Floats, sigmas: Floats) -> Onset | None:
    """First contact of one push from its frames' motor angles (n,) [rad] and bend amplitudes (n,).

    `sigmas` (n,) are those of the amplitudes, which may have any unit: f / (6 EI) of
    `nearest_linear_bend`, a force, a deflection at the tip. The model is a h + b h^2 with h the
    angle beyond the onset, or zero before it; b / a has a prior of the size that large deflection
    gives it. None where fewer than two frames are significantly bent, or the angle stands still.
    Raises ValueError if the three do not match or a sigma is not positive.
    """
    angles, amplitudes, sigmas = (np.asarray(v, float) for v in (angles, amplitudes, sigmas))
    if not angles.shape == amplitudes.shape == sigmas.shape == (len(angles),):
        raise ValueError("angles, amplitudes and sigmas differ in length")
    if not (sigmas > 0).all() or not np.isfinite([angles, amplitudes, sigmas]).all():
        raise ValueError("an amplitude is not finite, or its sigma not positive")
    bent = amplitudes > LEAST_SIGNIFICANCE * sigmas
    if bent.sum() < LEAST_FRAMES or np.ptp(angles[bent]) <= 0:
        return None
    weight = 1 / sigmas**2
    middle = float(weight @ angles / weight.sum())
    direction = 1.0 if (weight * (angles - middle)) @ amplitudes > 0 else -1.0
    pushed = direction * angles
    first, growth = _straight(pushed, amplitudes, weight)
    prior = 1 / (CURVATURE_SIGMA * growth) ** 2

    def profile(starts: Floats) -> tuple[Floats, Floats]:
        """Chi^2 (m,) at onsets (m,), growth and bend being linear and eliminated; growth (m,)."""
        beyond = np.maximum(pushed - starts[:, None], 0.0)
        h2, h3, h4 = beyond**2 @ weight, beyond**3 @ weight, beyond**4 @ weight + prior
        r1, r2 = beyond @ (weight * amplitudes), beyond**2 @ (weight * amplitudes)
        determinant = np.maximum(h2 * h4 - h3**2, 1e-300)
        slope, bend = (h4 * r1 - h3 * r2) / determinant, (h2 * r2 - h3 * r1) / determinant
        left = weight @ amplitudes**2 - slope * r1 - bend * r2
        return np.asarray(left), np.asarray(slope)

    # The profile has a kink wherever a frame passes the onset, so it is read on a grid that closes
    # in, and sigma is half the width within which chi^2 grows by one.
    dof = max(len(angles) - 2, 0)
    low, high = first - float(np.ptp(angles)), float(np.sort(pushed[bent])[-LEAST_FRAMES])
    for _ in range(CLOSING_IN):
        starts = np.linspace(low, high, 401)
        chi2, slope = profile(starts)
        best = int(np.argmin(chi2))
        widening = max(float(chi2[best]) / dof, 1.0) if dof else 1.0
        within = np.flatnonzero(chi2 <= chi2[best] + widening)
        near = np.flatnonzero(chi2 <= chi2[best] + 9 * widening)
        low, high = starts[max(near[0] - 1, 0)], starts[min(near[-1] + 1, 400)]
    if slope[best] <= 0:
        return None
    width = starts[min(within[-1] + 1, 400)] - starts[max(within[0] - 1, 0)]
    return Onset(
        angle=direction * float(starts[best]),
        sigma=float(width) / 2,
        growth=direction * float(slope[best]),
        chi2=max(float(chi2[best]), 0.0),
        dof=dof,
    )


def _straight(pushed: Floats, amplitudes: Floats, weight: Floats) -> tuple[float, float]:
    """Onset and growth without the bend: the best of all splits into straight and bent frames.

    Beyond its onset the model is a straight line, so every split is a linear problem.
    """
    order = np.argsort(pushed, kind="stable")
    t, a, w = pushed[order], amplitudes[order], weight[order]
    best = (math.inf, float(t[0]), 1.0)
    for split in range(len(t) - 1):
        if np.ptp(t[split:]) <= 0:
            break
        total = w[split:].sum()
        mean_t, mean_a = (w[split:] @ v[split:] / total for v in (t, a))
        spread = w[split:] @ (t[split:] - mean_t) ** 2
        growth = float(w[split:] @ ((t[split:] - mean_t) * (a[split:] - mean_a)) / spread)
        if growth <= 0:
            continue
        start = float(mean_t - mean_a / growth)
        beyond = np.maximum(t - start, 0.0)
        chi2 = float(w @ (a - growth * beyond) ** 2)
        if chi2 < best[0]:
            best = (chi2, start, growth)
    return best[1], best[2]
