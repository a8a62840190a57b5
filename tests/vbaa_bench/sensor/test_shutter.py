"""Weights of poses against the integrals that they stand for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from solver.instrument.arrays import Floats
from vbaa_bench.sensor.shutter import STEADY, Flicker, Shutter, effective_count

shutters = st.builds(
    Shutter, st.floats(1e-4, 0.1), st.one_of(st.just(0.0), st.floats(1e-6, 1e-3)), st.integers(1, 9)
)
lights = st.builds(
    Flicker, st.floats(0, 1), st.floats(2 * np.pi * 10, 2 * np.pi * 500), st.floats(0, 2 * np.pi)
)


def row_times(shutter: Shutter) -> Floats:
    return np.asarray(shutter.line_time * (np.arange(shutter.rows) - (shutter.rows - 1) / 2))


@given(shutters, lights, st.integers(1, 30))
def test_the_light_of_a_row_is_the_mean_of_a_cosine(
    shutter: Shutter, light: Flicker, poses: int
) -> None:
    depth, frequency, phase = light
    # The mean of a cosine over an interval is the cosine in its middle times a sinc.
    shrunk = depth * np.sinc(frequency * shutter.exposure / 2 / np.pi)
    power = 1 + shrunk * np.cos(frequency * row_times(shutter) + phase)
    assert shutter.weights(poses, light).sum(axis=1) == pytest.approx(power, abs=1e-9)


@given(shutters, st.integers(2, 30))
def test_what_moves_evenly_is_seen_at_the_time_of_its_row(shutter: Shutter, poses: int) -> None:
    times = np.linspace(-shutter.span / 2, shutter.span / 2, poses)
    weights = shutter.weights(poses, STEADY)
    assert weights.min() > -1e-9
    assert weights @ times == pytest.approx(row_times(shutter), abs=1e-9 * shutter.span)


def test_weights_are_integrals_of_interpolation_and_light() -> None:
    shutter, light, poses = Shutter(0.004, 0.0013, 4), Flicker(0.4, 700.0, 1.0), 6
    nodes = np.linspace(-shutter.span / 2, shutter.span / 2, poses)
    for weights, middle in zip(shutter.weights(poses, light), row_times(shutter), strict=True):
        for number, hat in enumerate(np.eye(poses)):

            def seen(t: float, hat: Floats = hat) -> float:
                return float(np.interp(t, nodes, hat) * (1 + 0.4 * np.cos(700 * t + 1)))

            integral, _ = quad(seen, middle - 0.002, middle + 0.002, points=nodes, limit=200)
            assert weights[number] == pytest.approx(integral / 0.004, abs=1e-9)


def edge(position: Floats) -> Floats:
    """Radiance at a smooth edge that has passed by some distance."""
    return np.asarray(norm.cdf(position))


def edge_integral(position: Floats) -> Floats:
    return np.asarray(position * norm.cdf(position) + norm.pdf(position))


@pytest.mark.parametrize("exposure", [0.01, 0.0003])
def test_a_moving_edge_converges_with_the_square_of_the_interval(exposure: float) -> None:
    # The edge crosses the image within the readout; a short exposure is below the intervals.
    shutter, speed = Shutter(exposure, 2e-4, 101), 300.0
    middle = row_times(shutter)
    ends = (speed * (middle + exposure / 2), speed * (middle - exposure / 2))
    true = (edge_integral(ends[0]) - edge_integral(ends[1])) / (speed * exposure)

    def error(poses: int) -> float:
        times = np.linspace(-shutter.span / 2, shutter.span / 2, poses)
        return float(np.abs(shutter.weights(poses) @ edge(speed * times) - true).max())

    errors = np.array([error(poses) for poses in (21, 41, 81, 161)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders.min() > 1.8
    assert errors[-1] < 3e-4


def test_all_poses_count_for_a_global_shutter_and_few_for_a_short_one() -> None:
    trapezoid = np.array([0.5, 1, 1, 1, 0.5]) / 4
    weights = Shutter(0.01, 0.0, 3).weights(5)
    assert weights == pytest.approx(np.tile(trapezoid, (3, 1)))
    assert effective_count(weights) == pytest.approx(1 / (trapezoid**2).sum())
    # In the first row, almost only the first pose is seen.
    assert effective_count(Shutter(1e-7, 1e-3, 11).weights(5)) == pytest.approx(1, abs=1e-3)
    assert effective_count(Shutter(0.01, 1e-3, 11).weights(1)) == 1
