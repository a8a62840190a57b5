import dataclasses

import numpy as np
import pytest

from solver.beams.linear import unit_deflection
from solver.fitting.first_contact import Bend, nearest_linear_bend, no_contact
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.measurement import Measurement
from tests.simulated import BEAM, measurement, pushed_points

SIGMA = 0.05 * 0.51e-3  # 0.05 px
X = np.arange(0.003, 0.24, 0.51e-3)


def seen(y: Floats, base_sigma: float = 0.0, tilt_sigma: float | None = None) -> Measurement:
    plain = measurement(np.column_stack([X, y]), SIGMA, base_sigma)
    if tilt_sigma is None:
        return plain
    base = plain.base_covariance.copy()
    base[2, 2] = tilt_sigma**2
    return dataclasses.replace(plain, base_covariance=base)


def coloured(random: np.random.Generator, length: float) -> Floats:
    """Noise of unit variance whose neighbours err together over `length` columns."""
    kernel = np.exp(-(np.arange(-60, 61) ** 2) / (2 * length**2))
    noise = np.convolve(random.standard_normal(len(X) + 120), kernel, mode="valid")
    return np.asarray(noise / np.linalg.norm(kernel))


@pytest.mark.parametrize(
    ("base_sigma", "neighbours"),
    [
        (0.0, 0.0),
        (1e-5, 3.0),
        pytest.param(0.0, 3.0, marks=pytest.mark.thorough),
        pytest.param(1e-5, 0.0, marks=pytest.mark.thorough),
    ],
)
def test_a_straight_beam_is_never_a_contact(
    base_sigma: float, neighbours: float, random: np.random.Generator
) -> None:
    significances = []
    for _ in range(1500):
        shift, turn = base_sigma * random.standard_normal(2) * [1, 10]
        noise = coloured(random, neighbours) if neighbours else random.standard_normal(len(X))
        bend = nearest_linear_bend(seen(SIGMA * noise + shift + turn * X, base_sigma))
        significances.append(bend.significance)
    # 1.02 to 1.32; errors of neighbours have longer tails, and five sigmas once in 3,000 frames.
    assert 0.85 < np.std(significances) < 1.6
    assert np.count_nonzero(np.abs(significances) >= 5) <= (15 if neighbours else 0)


def test_a_straight_line_at_any_angle_is_no_contact_if_the_clamp_may_be_turned(
    random: np.random.Generator,
) -> None:
    for angle in np.radians([-80, -30, -5, 0, 20, 60, 85]):
        along, across = (
            np.array([np.cos(angle), np.sin(angle)]),
            np.array([-np.sin(angle), np.cos(angle)]),
        )
        noise = SIGMA * random.standard_normal((len(X), 1))
        points = X[:, None] * along + noise * across
        loose = seen(X * 0, tilt_sigma=2.0)
        view = dataclasses.replace(
            loose.view, points=points, sigma_vectors=np.tile(SIGMA * across, (len(X), 1))
        )
        bend = nearest_linear_bend(dataclasses.replace(loose, view=view))
        assert abs(bend.significance) < 5
        assert bend.tilt == pytest.approx(angle, abs=0.05)


@pytest.mark.parametrize("x_c", [0.1, 0.18])
@pytest.mark.parametrize("tilt_sigma", [1e-8, 1e-4, 2.0])
def test_a_bend_of_sixty_sigmas_is_always_found(
    x_c: float, tilt_sigma: float, random: np.random.Generator
) -> None:
    shape = unit_deflection(X, x_c)
    strong = nearest_linear_bend(seen(shape, tilt_sigma=tilt_sigma))
    load = 60 * strong.sigma / strong.variance_inflation**0.5
    found = 0
    for _ in range(200):
        turn = min(tilt_sigma, 0.1) * random.standard_normal()
        noise = SIGMA * random.standard_normal(len(X))
        bend = nearest_linear_bend(seen(load * shape + noise + turn * X, tilt_sigma=tilt_sigma))
        found += no_contact(bend) is None
    assert found >= 198


def test_the_amplitudes_sigma_is_honest(random: np.random.Generator) -> None:
    x_c, base_sigma = 0.12, 5e-6
    load = 0.02 * 0.24 / float(unit_deflection(0.24, x_c))
    pulls = []
    for _ in range(300):
        shift, turn = base_sigma * random.standard_normal(2) * [1, 10]
        y = load * unit_deflection(X, x_c) + shift + turn * X
        bend = nearest_linear_bend(seen(y + SIGMA * random.standard_normal(len(X)), base_sigma))
        tip = bend.amplitude * float(unit_deflection(0.24, bend.x_c))
        pulls.append((tip / (0.02 * 0.24) - 1) * bend.significance)
    # With a place that is free the deflection at the tip is known hardly worse than at a fixed one.
    assert 0.7 < np.std(pulls) < 1.6


def test_it_is_the_beam_that_made_the_points(random: np.random.Generator) -> None:
    for place, deflection in ((0.05, 0.05), (0.15, 0.1)):
        points, x_c, force = pushed_points(place, deflection)
        bend = nearest_linear_bend(measurement(points, SIGMA))
        assert bend.x_c == pytest.approx(x_c, abs=0.01 * BEAM.length)
        assert 6 * BEAM.flexural_rigidity * bend.amplitude == pytest.approx(force, rel=0.1)
    shuffled = random.permutation(points)
    again = nearest_linear_bend(measurement(shuffled, SIGMA))
    assert again.x_c == pytest.approx(bend.x_c, rel=1e-9)
    assert again.significance == pytest.approx(bend.significance, rel=1e-6)


def test_repeated_points_do_not_count_twice(random: np.random.Generator) -> None:
    y = SIGMA * random.standard_normal(len(X)) + 1e-3 * X**2
    once = nearest_linear_bend(seen(y))
    twice = nearest_linear_bend(measurement(np.column_stack([X, y]).repeat(2, axis=0), SIGMA))
    assert abs(twice.significance) == pytest.approx(abs(once.significance), rel=0.45)


def test_a_scaled_world_gives_the_same_significance(random: np.random.Generator) -> None:
    y = SIGMA * random.standard_normal(len(X)) + 1e-2 * X**2
    large = seen(y, 1e-6)
    small = dataclasses.replace(
        large,
        view=dataclasses.replace(
            large.view, points=large.points * 1e-3, sigma_vectors=large.sigma_vectors * 1e-3
        ),
        base_covariance=large.base_covariance * np.outer([1e-3, 1e-3, 1], [1e-3, 1e-3, 1]),
        rig=dataclasses.replace(
            large.rig, beam=dataclasses.replace(BEAM, length=BEAM.length * 1e-3)
        ),
    )
    one, other = nearest_linear_bend(large), nearest_linear_bend(small)
    assert other.significance == pytest.approx(one.significance, rel=1e-3)
    assert other.x_c == pytest.approx(one.x_c * 1e-3, rel=1e-3)


def test_answers_where_there_is_nothing_to_see() -> None:
    for count in (0, 1, 3):
        bend = nearest_linear_bend(measurement(np.zeros((count, 2)) + 0.01, SIGMA))
        refusal = no_contact(bend)
        assert refusal is not None
        assert refusal.outcome is Outcome.NO_CONTACT
    same = nearest_linear_bend(measurement(np.full((50, 2), 0.1), SIGMA))
    assert np.isfinite([same.x_c, same.amplitude, same.significance]).all()
    other_side = no_contact(Bend(0.1, -1.0, -100.0))
    assert other_side is not None
    assert other_side.outcome is Outcome.INVALID
