"""Constraints beside the points: tip, moment sensor, and the priors of clamp, length and EI.

Each is added to the normal equations of a fit, in the parameters and units of `residuals`.
"""

import numpy as np

from solver.beam_models.exact import contact_at
from solver.fitting.residuals import (
    DX,
    DY,
    LEVER,
    MOMENT,
    MOMENT_SIGMA,
    MOMENT_UNIT,
    PARAMETERS,
    PSI,
    RIGIDITY,
    RIGIDITY_SIGMA,
    STRETCH,
    STRETCH_SIGMA,
    TILT,
    Q,
)
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit

# Columns of a tip: its image on C, the rows of the matrix that whitens its error, its view index.
TIP_COLUMNS = 7


@njit
def add_constraints(
    p: Floats,
    views: Floats,
    tips: Floats,
    known: Floats,
    base_whitening: Floats,
    normal: Floats,
    gradient: Floats,
) -> float:
    """Add all constraints to J^T J (8, 8) and J^T r (8,); return their sum of squared residuals."""
    chi2 = 0.0
    for white in base_whitening:
        value = white[0] * p[DX] + white[1] * p[DY] + white[2] * p[TILT]
        chi2 += value * value
        for j in range(3):
            gradient[DX + j] += white[j] * value
            for k in range(3):
                normal[DX + j, DX + k] += white[j] * white[k]
    if known[MOMENT_SIGMA] > 0:
        # The exact moment at the clamp is F lever; its component about y is -x_c f_z of eq. (27).
        unit = -known[MOMENT_UNIT] / known[MOMENT_SIGMA]
        sine, stiff = np.sin(p[PSI]), 1 + p[RIGIDITY]
        row = np.zeros(PARAMETERS)
        row[Q], row[LEVER] = unit * stiff * p[LEVER] * sine, unit * stiff * p[Q] * sine
        row[PSI] = unit * stiff * p[Q] * p[LEVER] * np.cos(p[PSI])
        row[RIGIDITY] = unit * p[Q] * p[LEVER] * sine
        value = row[RIGIDITY] * stiff - known[MOMENT] / known[MOMENT_SIGMA]
        chi2 += _add(row, value, normal, gradient)
        row[:] = 0.0
        row[RIGIDITY] = 1 / known[RIGIDITY_SIGMA]
        chi2 += _add(row, p[RIGIDITY] * row[RIGIDITY], normal, gradient)
    if len(tips) > 0:
        row = np.zeros(PARAMETERS)
        row[STRETCH] = 1 / known[STRETCH_SIGMA]
        chi2 += _add(row, p[STRETCH] * row[STRETCH], normal, gradient)
        for tip in tips:
            chi2 += _add_tip(p, tip, views[int(tip[6])], normal, gradient)
    return chi2


@njit
def _add_tip(p: Floats, tip: Floats, view: Floats, normal: Floats, gradient: Floats) -> float:
    """Add the predicted less the measured image of the tip of a known length; return chi2."""
    theta, x_c, y_c, s_c = contact_at(p[Q], p[LEVER])
    sine, cosine = np.sin(theta[0]), np.cos(theta[0])
    beyond = 1 + p[STRETCH] - s_c[0]
    x, y = x_c[0] + beyond * cosine, y_c[0] + beyond * sine
    by_x, by_y = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    for j in range(2):
        by_x[j] = x_c[1 + j] - s_c[1 + j] * cosine - beyond * sine * theta[1 + j]
        by_y[j] = y_c[1 + j] - s_c[1 + j] * sine + beyond * cosine * theta[1 + j]
    by_x[STRETCH], by_y[STRETCH] = cosine, sine
    # Transform to the clamp's axes, then to plane C; the tip's height shifts its image.
    cos_psi, sin_psi = np.cos(p[PSI]), np.sin(p[PSI])
    side, height = y * cos_psi, y * sin_psi
    by_side, by_height = by_y * cos_psi, by_y * sin_psi
    by_side[PSI], by_height[PSI] = -height, side
    c, s = np.cos(p[TILT]), np.sin(p[TILT])
    turned_x, turned_y = c * x - s * side, s * x + c * side
    on_x, on_y = p[DX] + turned_x, p[DY] + turned_y
    by_on_x, by_on_y = c * by_x - s * by_side, s * by_x + c * by_side
    by_on_x[DX], by_on_y[DY] = 1.0, 1.0
    by_on_x[TILT], by_on_y[TILT] = -turned_y, turned_x
    # The ray from P through V meets C at P - P_z (V_xy - V_w P_xy) / (1 - V_w P_z).
    share = height / (1 - view[2] * height)
    by_share = by_height / (1 - view[2] * height) ** 2
    to_x, to_y = view[0] - view[2] * on_x, view[1] - view[2] * on_y
    miss_x, miss_y = on_x - share * to_x - tip[0], on_y - share * to_y - tip[1]
    by_miss_x = by_on_x * (1 + share * view[2]) - by_share * to_x
    by_miss_y = by_on_y * (1 + share * view[2]) - by_share * to_y
    chi2 = 0.0
    for i in range(2):
        one, two = tip[2 + 2 * i], tip[3 + 2 * i]
        row = one * by_miss_x + two * by_miss_y
        chi2 += _add(row, one * miss_x + two * miss_y, normal, gradient)
    return chi2


@njit
def _add(row: Floats, value: float, normal: Floats, gradient: Floats) -> float:
    for a in range(PARAMETERS):
        gradient[a] += row[a] * value
        for b in range(PARAMETERS):
            normal[a, b] += row[a] * row[b]
    return value * value
