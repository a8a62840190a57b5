import numpy as np
import pytest

from solver.baselines.three_point import three_point
from solver.beams.linear import unit_deflection
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from tests.inclined import VIEWPOINT, inclined, on_plane_c, pushed
from tests.simulated import BEAM, columns

SIGMA = 0.05 * 0.51e-3
EI = BEAM.flexural_rigidity
OVER_THE_CLAMP = np.array([0.0, 0.0, 0.36, 1.0])


def linear(x_c: float, psi: float, viewpoint: Floats = VIEWPOINT) -> tuple[Floats, float]:
    """Columns on C of a linear beam in the plane psi, bent to 10 % of its length; its load."""
    x = np.linspace(0, 0.24, 40_001)
    load = 0.024 / float(unit_deflection(0.24, x_c))
    on_c = on_plane_c(np.column_stack([x, load * unit_deflection(x, x_c)]), psi, viewpoint)
    return columns(np.column_stack([x, on_c, x])), load


@pytest.mark.parametrize("psi_deg", [-60, -30, 0, 30, 60])
@pytest.mark.parametrize("x_c", [0.08, 0.15, 0.2])
def test_finds_the_plane_of_a_linear_beam_on_all_its_parts(x_c: float, psi_deg: float) -> None:
    psi = np.radians(psi_deg)
    points, load = linear(x_c, psi)
    answer = three_point(inclined(points, 1e-8))
    # The parabolas through a stretch of the cubic err by a few nanometres.
    assert answer.values["psi_rad"] == pytest.approx(psi, abs=np.radians(0.4))
    assert answer.values["x_c_m"] == pytest.approx(x_c, abs=5e-4 * BEAM.length)
    assert answer.values["force_n"] == pytest.approx(6 * EI * load, rel=3e-3)


def test_points_beyond_the_contact_do_not_mislead_it() -> None:
    # Where the printed (25) gives 28 deg, then -6 deg, then no root: psi is 30 deg and the farther
    # points lie ever farther beyond the contact.
    points, _ = linear(0.1, np.radians(30))
    for end in (0.11, 0.15, 0.2, 0.24):
        answer = three_point(inclined(points[points[:, 0] < end], 1e-9))
        assert np.degrees(answer.values["psi_rad"]) == pytest.approx(30, abs=1.5)


def test_a_second_root_is_told() -> None:
    points, _ = linear(0.18, np.radians(20), OVER_THE_CLAMP)
    answer = three_point(inclined(points, 1e-8, viewpoint=OVER_THE_CLAMP))
    assert np.degrees(answer.values["psi_rad"]) == pytest.approx(20, abs=1)
    assert answer.message.endswith("other inclinations, 86, 86 deg")
    # Where the contacts of both pairs are at infinity, their difference is 0 but for rounding.
    nearer, _ = linear(0.15, np.radians(20), OVER_THE_CLAMP)
    answer = three_point(inclined(nearer, 1e-8, viewpoint=OVER_THE_CLAMP))
    assert "other inclinations" not in answer.message
    # Seen from beside the clamp, perspective leaves one.
    aside, _ = linear(0.18, np.radians(20))
    assert "other inclinations" not in three_point(inclined(aside, 1e-8)).message


@pytest.mark.thorough
def test_under_noise_it_errs_as_much_as_it_says(random: np.random.Generator) -> None:
    errors, pulls = [], []
    for psi in np.radians([0, 20, 40]):
        for x_c in (0.11, 0.17):
            clean, _ = linear(x_c, psi)
            for _ in range(15):
                noise = np.column_stack([np.zeros(len(clean)), random.normal(0, SIGMA, len(clean))])
                answer = three_point(inclined(clean + noise, SIGMA))
                if not answer.values:
                    continue
                error = np.array([answer.values["psi_rad"] - psi, answer.values["x_c_m"] - x_c])
                errors.append(error)
                pulls.append(error / [answer.sigma("psi_rad"), answer.sigma("x_c_m")])
    assert len(errors) >= 81  # of 90
    # Perspective determines psi to some twenty degrees (the note beside the paper: 16 to 21), and
    # x_c stays as it was.
    psi_rms, x_c_rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert 5 < np.degrees(psi_rms) < 35
    assert x_c_rms < 0.05 * BEAM.length
    # Pulls have heavy tails. If two thirds of them are between these bounds, the median of 30 is
    # outside in less than one of 100,000 seeds.
    typical = np.median(np.abs(pulls), axis=0)
    assert (typical > 0.2).all()
    assert (typical < 2.5).all()


def test_large_deflection_biases_psi() -> None:
    points, truth = pushed(0.17, 0.1, np.radians(20))
    answer = three_point(inclined(points, 1e-6))
    bias = np.degrees(answer.values["psi_rad"] - truth["psi_rad"])
    assert 2 < abs(bias) < 30


def test_what_it_cannot_answer_is_said() -> None:
    points, _ = linear(0.15, 0.3)
    few = three_point(inclined(points[:50], SIGMA))
    assert few.outcome is Outcome.NOT_IDENTIFIABLE
    straight = three_point(inclined(points * [1, 0], SIGMA))
    assert straight.outcome is Outcome.NO_CONTACT
    collinear = three_point(inclined(points * [1, 0] + points[:, :1] * [0, 0.1], SIGMA))
    assert not collinear.values
    same = three_point(inclined(np.full((100, 2), 0.1), SIGMA))
    assert not same.values
    short = three_point(inclined(points[:75], SIGMA))  # 4 cm: no three points L / 12 apart
    assert not short.values
    # A camera infinitely far above C sees no perspective: the width of a plane's shadow is all.
    above = np.array([0.0, 0.0, 1.0, 0.0])
    blind = three_point(inclined(linear(0.15, 0.3, above)[0], SIGMA, viewpoint=above))
    assert blind.outcome is Outcome.NOT_IDENTIFIABLE
    assert blind.message


@pytest.mark.parametrize("psi", [0.0, 0.3])
def test_errors_of_the_clamp_enter_the_covariance_by_their_derivatives(psi: float) -> None:
    """Compare with finite differences of the estimate by the clamp's dx, dy and tilt."""
    names, base_sigma, step = ["psi_rad", "x_c_m", "force_n"], 1e-7, 1e-7
    points, _ = linear(0.15, psi)
    x, zero, one = points[:, 0], np.zeros(len(points)), np.ones(len(points))

    def estimate(shift: Floats) -> Estimate:
        return three_point(inclined(points + shift, 1e-10, base_sigma=base_sigma))

    def values(shift: Floats) -> Floats:
        by_name = estimate(shift).values
        return np.array([by_name[name] for name in names])

    shifts = [step * np.column_stack(pair) for pair in ((one, zero), (zero, one), (zero, x))]
    by_clamp = [(values(shift) - values(-shift)) / (2 * step) for shift in shifts]
    scaled = np.column_stack(by_clamp) * base_sigma * [1, 1, 10]
    expected = scaled @ scaled.T
    unmoved = estimate(0 * points)
    rows = [list(unmoved.values).index(name) for name in names]
    assert unmoved.covariance is not None
    stated = unmoved.covariance[np.ix_(rows, rows)]
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert stated / size == pytest.approx(expected / size, abs=5e-3)
