import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import hyp2f1

from solver.beams import exact
from solver.instrument.arrays import Floats
from tests.oracle import oracle

SHAPES = st.tuples(st.floats(0.005, 0.24), st.floats(1e-4, 0.9))  # lever [m], sin(theta_c)


def contact(q: float, lever: float) -> Floats:
    """Rows theta_c, x_c, y_c, s_c; columns value, d/dq, d/dlever."""
    return np.array(exact.contact_at(q, lever))


@pytest.mark.parametrize("row", oracle()["A_frictionless_contact"], ids=lambda row: str(row["id"]))
def test_equals_the_oracle(row: dict[str, object]) -> None:
    def value(key: str) -> float:
        return float(str(row[key]))

    inputs = row["inputs"]
    assert isinstance(inputs, dict)
    q = value("F_N") / value("EI_Nm2")
    lever = value("moment_base_Nm") / value("F_N")
    expected = (
        float(inputs["theta_c_rad"]),
        value("x_c_m"),
        value("y_c_m"),
        float(inputs["s_c_m"]),
    )
    assert contact(q, lever)[:, 0] == pytest.approx(expected, rel=1e-13)


@given(SHAPES)
def test_gradients_equal_finite_differences(shape: tuple[float, float]) -> None:
    lever, sine = shape
    q = 2 * sine / lever**2
    at = contact(q, lever)
    for column, (dq, dl) in enumerate(((1e-5 * q, 0.0), (0.0, 1e-5 * lever)), start=1):
        ahead, behind = contact(q + dq, lever + dl), contact(q - dq, lever - dl)
        slope = (ahead - behind)[:, 0] / (2 * (dq + dl))
        # x_c and s_c change little with q at small angles: compare on the scale of y_c.
        scale = np.abs(at[2, column]) + np.abs(at[:, column])
        assert np.abs(slope - at[:, column]) == pytest.approx(0, abs=1e-6 * scale.max())


@given(SHAPES, st.floats(1e-3, 1e3))
def test_lengths_scale_together(shape: tuple[float, float], scale: float) -> None:
    lever, sine = shape
    q = 2 * sine / lever**2
    one, other = contact(q, lever)[:, 0], contact(q / scale**2, lever * scale)[:, 0]
    assert other == pytest.approx(one * [1, scale, scale, scale], rel=1e-12)


def test_its_series_are_the_hypergeometric_functions() -> None:
    sine = np.linspace(0, 0.995, 200)
    q = 2 * sine  # at u = 1
    p = np.array([exact.bend_at(1.0, one)[0] for one in q])
    assert p == pytest.approx(sine / 3 * hyp2f1(0.5, 0.75, 1.75, sine**2), rel=1e-12)
    s_c = np.array([contact(one, 1.0)[3, 0] for one in q])
    assert s_c == pytest.approx(hyp2f1(0.5, 0.25, 1.25, sine**2), rel=1e-12)
    gentle = sine[sine < exact.GENTLE_SINE]
    t = (1 - np.sqrt(1 - gentle**2)) * 2 / exact.GENTLE - 1
    assert np.polynomial.polynomial.polyval(t, exact.BEND_GENTLE) == pytest.approx(
        hyp2f1(0.5, 0.75, 1.75, gentle**2), rel=1e-14
    )


def test_a_vanishing_force_is_regular() -> None:
    at = contact(0.0, 0.12)
    assert at[:, 0] == pytest.approx([0.0, 0.12, 0.0, 0.12], rel=1e-15)
    assert np.isfinite(at).all()
