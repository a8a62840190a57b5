"""Add constraints to the fit: tip, moment sensor, and priors of clamp, length and EI.

Each is added to the normal equations of a fit, in the parameters and units of `residuals`.
"""

import numpy as np

from solver.beams.exact import contact_at
from solver.instrument.arrays import Floats
from solver.instrument.compiled import njit
from solver.uniform.residuals import (
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
    FrameArrays,
    Q,
)

# Columns of a tip: its image on C, the rows of the matrix that whitens its error, and its rim's
# height above the axis.
TIP_COLUMNS = 7


@njit
def add_constraints(p: Floats, problem: FrameArrays, normal: Floats, gradient: Floats) -> float:
    """Add all constraints to J^T J (8, 8) and J^T r (8,); return their sum of squared residuals."""
    _, view, tips, known, base_whitening = problem
    chi2 = 0.0
    for whitener in base_whitening:
        value = whitener[0] * p[DX] + whitener[1] * p[DY] + whitener[2] * p[TILT]
        chi2 += value * value
        for j in range(3):
            gradient[DX + j] += whitener[j] * value
            for k in range(3):
                normal[DX + j, DX + k] += whitener[j] * whitener[k]
    if known[MOMENT_SIGMA] > 0:
        # The exact moment at the clamp is F lever; its component about y is -x_c f_z of eq. (27).
        unit = -known[MOMENT_UNIT] / known[MOMENT_SIGMA]
        sine, rigidity = np.sin(p[PSI]), 1 + p[RIGIDITY]
        row = np.zeros(PARAMETERS)
        row[Q], row[LEVER] = unit * rigidity * p[LEVER] * sine, unit * rigidity * p[Q] * sine
        row[PSI] = unit * rigidity * p[Q] * p[LEVER] * np.cos(p[PSI])
        row[RIGIDITY] = unit * p[Q] * p[LEVER] * sine
        value = row[RIGIDITY] * rigidity - known[MOMENT] / known[MOMENT_SIGMA]
        chi2 += _add(row, value, normal, gradient)
        row[:] = 0.0
        row[RIGIDITY] = 1 / known[RIGIDITY_SIGMA]
        chi2 += _add(row, p[RIGIDITY] * row[RIGIDITY], normal, gradient)
    if len(tips) > 0:
        row = np.zeros(PARAMETERS)
        row[STRETCH] = 1 / known[STRETCH_SIGMA]
        chi2 += _add(row, p[STRETCH] * row[STRETCH], normal, gradient)
        for tip in tips:
            chi2 += _add_tip(p, tip, view, normal, gradient)
    return chi2


@njit
def _add_tip(p: Floats, tip: Floats, view: Floats, normal: Floats, gradient: Floats) -> float:
    """Add the predicted less the measured image of the tip of a known length; return chi2."""
    theta, x_c, y_c, s_c = contact_at(p[Q], p[LEVER])
    sine, cosine = np.sin(theta[0]), np.cos(theta[0])
    cos_psi, sin_psi = np.cos(p[PSI]), np.sin(p[PSI])
    # The rim at which the beam is seen to end is nearer to the clamp where the end climbs from C.
    rim = tip[6]
    straight = 1 + p[STRETCH] - s_c[0] - rim * sine * sin_psi
    x, y = x_c[0] + straight * cosine, y_c[0] + straight * sine
    by_x, by_y = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    for j in range(2):
        by_straight = -s_c[1 + j] - rim * cosine * sin_psi * theta[1 + j]
        by_x[j] = x_c[1 + j] + by_straight * cosine - straight * sine * theta[1 + j]
        by_y[j] = y_c[1 + j] + by_straight * sine + straight * cosine * theta[1 + j]
    by_x[STRETCH], by_y[STRETCH] = cosine, sine
    by_x[PSI], by_y[PSI] = -rim * sine * cos_psi * cosine, -rim * sine * cos_psi * sine
    # Transform to the clamp's axes, then to plane C; the tip's height shifts its image.
    side, height = y * cos_psi, y * sin_psi
    by_side, by_height = by_y * cos_psi, by_y * sin_psi
    by_side[PSI] -= height
    by_height[PSI] += side
    c, s = np.cos(p[TILT]), np.sin(p[TILT])
    rotated_x, rotated_y = c * x - s * side, s * x + c * side
    base_x, base_y = p[DX] + rotated_x, p[DY] + rotated_y
    by_base_x, by_base_y = c * by_x - s * by_side, s * by_x + c * by_side
    by_base_x[DX], by_base_y[DY] = 1.0, 1.0
    by_base_x[TILT], by_base_y[TILT] = -rotated_y, rotated_x
    # The ray from P through V meets C at P - P_z (V_xy - V_w P_xy) / (1 - V_w P_z).
    fraction = height / (1 - view[2] * height)
    by_fraction = by_height / (1 - view[2] * height) ** 2
    ray_x, ray_y = view[0] - view[2] * base_x, view[1] - view[2] * base_y
    place_x, place_y = base_x - fraction * ray_x, base_y - fraction * ray_y
    by_place_x = by_base_x * (1 + fraction * view[2]) - by_fraction * ray_x
    by_place_y = by_base_y * (1 + fraction * view[2]) - by_fraction * ray_y
    # Nearer to the camera than plane C, the rim's height looks larger.
    larger = rim * view[2]
    outward_x, outward_y = view[2] * place_x - view[0], view[2] * place_y - view[1]
    error_x = place_x + larger * fraction * outward_x - tip[0]
    error_y = place_y + larger * fraction * outward_y - tip[1]
    scale = 1 + larger * fraction * view[2]
    by_error_x = by_place_x * scale + by_fraction * (larger * outward_x)
    by_error_y = by_place_y * scale + by_fraction * (larger * outward_y)
    chi2 = 0.0
    for i in range(2):
        white_x, white_y = tip[2 + 2 * i], tip[3 + 2 * i]
        row = white_x * by_error_x + white_y * by_error_y
        chi2 += _add(row, white_x * error_x + white_y * error_y, normal, gradient)
    return chi2


@njit
def _add(row: Floats, value: float, normal: Floats, gradient: Floats) -> float:
    for a in range(PARAMETERS):
        gradient[a] += row[a] * value
        for b in range(PARAMETERS):
            normal[a, b] += row[a] * row[b]
    return value * value
