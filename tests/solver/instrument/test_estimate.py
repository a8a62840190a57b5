import numpy as np
import pytest

from solver.instrument.estimate import Estimate, Outcome


def test_values_and_outcome_must_agree() -> None:
    with pytest.raises(ValueError, match="no contact"):
        Estimate(Outcome.NO_CONTACT, values={"x_c_m": 0.1}, covariance=np.eye(1))
    with pytest.raises(ValueError, match="contact"):
        Estimate(Outcome.CONTACT)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_never_nan(bad: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        Estimate(Outcome.CONTACT, values={"x_c_m": bad}, covariance=np.eye(1))
    with pytest.raises(ValueError, match="finite"):
        Estimate(Outcome.CONTACT, values={"x_c_m": 0.1}, covariance=np.full((1, 1), bad))


def test_an_estimate_cannot_be_written_to() -> None:
    estimate = Estimate(Outcome.CONTACT, values={"x_c_m": 0.1}, covariance=np.eye(1))
    assert estimate.covariance is not None
    with pytest.raises(ValueError, match="read-only"):
        estimate.covariance[0, 0] = 2.0
    assert estimate.sigma("x_c_m") == 1.0


def test_an_unknown_covariance_is_allowed_and_an_unknown_name_not() -> None:
    estimate = Estimate(Outcome.CONTACT, values={"x_c_m": 0.1})
    with pytest.raises(ValueError, match="no covariance"):
        estimate.sigma("x_c_m")
    with pytest.raises(ValueError, match="x_c_mm"):
        Estimate(Outcome.CONTACT, values={"x_c_mm": 100.0})


def test_every_outcome_has_a_sentence() -> None:
    assert all(outcome.sentence.endswith(".") for outcome in Outcome)


def test_the_correlation_of_two_values() -> None:
    values = {"x_c_m": 0.1, "force_n": 0.05, "y_c_m": 0.01}
    covariance = np.array([[4.0, -3.0, 0.0], [-3.0, 9.0, 0.0], [0.0, 0.0, 0.0]])
    estimate = Estimate(Outcome.CONTACT, values=values, covariance=covariance)
    assert estimate.correlation("force_n", "x_c_m") == pytest.approx(-0.5)
    assert estimate.correlation("x_c_m", "y_c_m") is None
    assert estimate.correlation("x_c_m", "psi_rad") is None
    assert Estimate(Outcome.CONTACT, values=values).correlation("x_c_m", "force_n") is None
