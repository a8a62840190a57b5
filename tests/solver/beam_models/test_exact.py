import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import hyp2f1

from solver.beam_models import exact, linear
from tests.oracle import oracle

SHAPES = st.tuples(st.floats(0.005, 0.24), st.floats(1e-4, 0.9))  # lever [m], sin(theta_c)


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_equals_the_oracle(row: dict[str, object]) -> None:
    def value(key: str) -> float:
        return float(str(row[key]))

    inputs = row["inputs"]
    assert isinstance(inputs, dict)
    q = value("F_N") / value("EI_Nm2")
    lever = value("moment_base_Nm") / value("F_N")
    at = exact.contact(q, lever)
    assert at.theta_c == pytest.approx(float(inputs["theta_c_rad"]), rel=1e-13)
    assert at.x_c == pytest.approx(value("x_c_m"), rel=1e-13)
    assert at.y_c == pytest.approx(value("y_c_m"), rel=1e-13)
    assert at.s_c == pytest.approx(float(inputs["s_c_m"]), rel=1e-13)

    samples = row["samples_by_s"]
    assert isinstance(samples, list)
    x, y = np.array([[float(s["x_m"]), float(s["y_m"])] for s in samples]).T
    misfit, _, _ = exact.misfit(x, y, q, lever)
    assert np.abs(misfit).max() < 1e-15  # a femtometre, on a beam of 0.24 m


def test_tends_to_linear_theory_with_order_two() -> None:
    x_c, x = 0.15, np.linspace(0.01, 0.24, 24)
    amplitudes = np.array([0.2, 0.1, 0.05])
    errors = []
    for q in amplitudes:
        y = q / 6 * linear.unit_deflection(x, x_c)
        misfit, _, _ = exact.misfit(x, y, q, x_c)
        errors.append(np.abs(misfit).max() / np.abs(y).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.02)


@given(SHAPES)
def test_gradients_equal_finite_differences(shape: tuple[float, float]) -> None:
    lever, sine = shape
    q = 2 * sine / lever**2
    x, y = np.linspace(0.0, 1.2 * lever, 9), np.linspace(0.0, 0.3 * lever, 9)
    at = exact.contact(q, lever)
    _, by_point, by_shape = exact.misfit(x, y, q, lever)
    step = 1e-5
    for column, (dq, dl) in enumerate(((q * step, 0.0), (0.0, lever * step))):
        ahead, behind = exact.contact(q + dq, lever + dl), exact.contact(q - dq, lever - dl)
        for name in ("theta_c", "x_c", "y_c", "s_c"):
            slope = (getattr(ahead, name) - getattr(behind, name)) / (2 * (dq + dl))
            gradient = getattr(at, f"d_{name}")[column]
            # x_c and s_c change little with q at small angles: compare on the scale of y_c.
            scale = abs(at.d_y_c[column]) + abs(gradient)
            assert slope == pytest.approx(gradient, rel=1e-6, abs=1e-6 * scale)
        difference = (
            exact.misfit(x, y, q + dq, lever + dl)[0] - exact.misfit(x, y, q - dq, lever - dl)[0]
        ) / (2 * (dq + dl))
        largest = np.abs(by_shape[:, column]).max()
        assert difference == pytest.approx(by_shape[:, column], abs=1e-5 * largest)
    h = 1e-6 * lever
    by_y = (exact.misfit(x, y + h, q, lever)[0] - exact.misfit(x, y - h, q, lever)[0]) / (2 * h)
    assert by_y == pytest.approx(by_point[:, 1], rel=1e-4, abs=1e-4)


@given(SHAPES, st.floats(1e-3, 1e3))
def test_lengths_scale_together(shape: tuple[float, float], scale: float) -> None:
    lever, sine = shape
    q = 2 * sine / lever**2
    one, other = exact.contact(q, lever), exact.contact(q / scale**2, lever * scale)
    assert other.theta_c == pytest.approx(one.theta_c, rel=1e-12)
    for name in ("x_c", "y_c", "s_c"):
        assert getattr(other, name) == pytest.approx(scale * getattr(one, name), rel=1e-12)


def test_its_series_are_the_hypergeometric_functions() -> None:
    sine = np.linspace(0, 0.995, 200)
    q = 2 * sine  # at u = 1
    p = np.array([exact.bend_at(1.0, one)[0] for one in q])
    assert p == pytest.approx(sine / 3 * hyp2f1(0.5, 0.75, 1.75, sine**2), rel=1e-12)
    assert exact.bend(np.ones(1), q[100])[0] == pytest.approx(p[100], rel=1e-14)
    s_c = np.array([exact.contact(one, 1.0).s_c for one in q])
    assert s_c == pytest.approx(hyp2f1(0.5, 0.25, 1.25, sine**2), rel=1e-12)
    gentle = sine[sine < exact.GENTLE_SINE]
    t = (1 - np.sqrt(1 - gentle**2)) * 2 / exact.GENTLE - 1
    assert np.polynomial.polynomial.polyval(t, exact.BEND_GENTLE) == pytest.approx(
        hyp2f1(0.5, 0.75, 1.75, gentle**2), rel=1e-14
    )


def test_a_vanishing_force_is_regular() -> None:
    at = exact.contact(0.0, 0.12)
    assert (at.theta_c, at.x_c, at.y_c) == (0.0, 0.12, 0.0)
    assert at.s_c == pytest.approx(0.12, rel=1e-15)
    misfit, _, by_shape = exact.misfit(np.array([0.1, 0.2]), np.array([0.0, 1e-3]), 0.0, 0.12)
    assert misfit == pytest.approx([0.0, 1e-3])
    assert np.isfinite(by_shape).all()
