"""The colour sensor: its filters, the noise of its channels, and the gray image."""

from typing import Any, get_args

import numpy as np
import pytest

from tests.draws import generator
from vbaa_bench.scene.image_sensor import BayerPattern, SensorSpec
from vbaa_bench.sensor.from_spec import image_sensor, metered_exposure
from vbaa_bench.sensor.mosaic import Mosaic
from vbaa_bench.sensor.quantise import quantise
from vbaa_bench.sensor.sensor import Sensor

PATTERNS = get_args(BayerPattern)
SIGNALS = {"r": 0.6, "g": 1.0, "b": 0.5}
# Rec. ITU-R BT.601, and how it weights gray light without white balance.
WEIGHTS = {"r": 0.299, "g": 0.587, "b": 0.114}
UNBALANCED = sum(WEIGHTS[c] * SIGNALS[c] for c in "rgb")


def mosaic(pattern: BayerPattern = "rggb", **keys: Any) -> Mosaic:
    return Mosaic(SIGNALS["r"], SIGNALS["g"], SIGNALS["b"], pattern, **keys)


@pytest.mark.parametrize("edge_aware", [False, True])
@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize(("bits", "black"), [(8, 16), (16, 900)])
def test_gray_light_is_gray_in_every_pattern(
    pattern: BayerPattern, edge_aware: bool, bits: int, black: int
) -> None:
    filters = mosaic(pattern, edge_aware=edge_aware)
    transmission = filters.transmission((20, 31))
    assert [transmission[place // 2, place % 2] for place in range(4)] == pytest.approx(
        [SIGNALS[channel] for channel in pattern]
    )
    raw = quantise((black + 200 * transmission) / (2**bits - 1), bits)
    assert filters.colours(raw, black) == pytest.approx(black + 200, abs=1e-3)
    tinted = mosaic(pattern, edge_aware=edge_aware, white_balance=False).colours(raw, black)
    blue_green_red = np.array([SIGNALS[c] for c in "bgr"])
    assert tinted == pytest.approx(np.broadcast_to(black + 200 * blue_green_red, tinted.shape))


@pytest.mark.parametrize("edge_aware", [False, True])
def test_a_plane_of_light_is_reconstructed_without_shift(edge_aware: bool) -> None:
    v, u = np.mgrid[0:24, 0:36]
    plane = 1000 + 40 * u + 80 * v
    filters = mosaic(edge_aware=edge_aware)
    raw = np.rint(plane * filters.transmission(plane.shape)).astype(np.uint16)
    inside = filters.colours(raw, 0.0)[2:-2, 2:-2]
    # Raw values and colours are rounded to one, over the smallest signal.
    assert inside == pytest.approx(np.repeat(plane[2:-2, 2:-2, None], 3, 2), abs=1 / 0.5)


def test_each_channel_has_the_photon_transfer_curve_of_its_light() -> None:
    sensor = Sensor(1.0, 20_000, 8, bits=12, gain=4.0, black_level=64, mosaic=mosaic())
    levels = np.linspace(10, 12_000, 8)
    frames = [
        sensor.photosites(np.full((700, 700), e), generator(__name__, i))
        for i, e in enumerate(levels)
    ]
    for place, channel in enumerate("rggb"):
        sites = np.array([frame[place // 2 :: 2, place % 2 :: 2] for frame in frames])
        means, variances = sites.mean(axis=(1, 2)), sites.var(axis=(1, 2))
        assert means == pytest.approx(64 + SIGNALS[channel] * levels / 4, rel=2e-3)
        assert np.polyfit(means, variances, 1)[0] == pytest.approx(1 / 4, rel=0.02)


def test_gray_has_the_noise_of_interpolated_and_balanced_channels(
    random: np.random.Generator,
) -> None:
    electrons, read, per_gray = 9_000.0, 20.0, 20_000 / 65_535
    sensor = Sensor(1.0, 20_000, read, bits=16, mosaic=mosaic())
    gray = sensor.expose(np.full((1200, 1200), electrons), random)[2:-2, 2:-2]
    assert gray.mean() * per_gray == pytest.approx(electrons, rel=1e-3)
    # Variance of each channel's share of gray, after white balance.
    share = {c: (WEIGHTS[c] / SIGNALS[c]) ** 2 * (SIGNALS[c] * electrons + read**2) for c in "rgb"}
    at_green = share["g"] + (share["r"] + share["b"]) / 2
    at_red = share["r"] + (share["g"] + share["b"]) / 4
    at_blue = share["b"] + (share["g"] + share["r"]) / 4
    for place, variance in enumerate([at_red, at_green, at_green, at_blue]):
        sites = gray[place // 2 :: 2, place % 2 :: 2]
        assert sites.var() * per_gray**2 == pytest.approx(variance, rel=0.02)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_noisy_render_and_the_sensor_make_the_noise_of_each_channel_together(
    share: float,
    random: np.random.Generator,
) -> None:
    sensor = Sensor(1.0, 20_000, 12, bits=16, gain=0.3, black_level=500, mosaic=mosaic())
    electrons = 4000.0
    sigma = np.sqrt(share * electrons)
    rendered = electrons + sigma * random.standard_normal((800, 800))
    raw = sensor.photosites(rendered, random, np.full(rendered.shape, sigma**2))
    for place, channel in enumerate("rggb"):
        sites = 0.3 * (raw[place // 2 :: 2, place % 2 :: 2] - 500.0)
        variance = SIGNALS[channel] * electrons + 12**2 + 0.3**2 / 12
        assert sites.mean() == pytest.approx(SIGNALS[channel] * electrons, rel=2e-3)
        assert sites.var() == pytest.approx(variance, rel=0.02)


@pytest.mark.parametrize("gamma", [1.0, 2.2])
@pytest.mark.parametrize("white_balance", [True, False])
def test_the_beam_peaks_where_the_most_sensitive_channel_does(
    gamma: float, white_balance: bool, random: np.random.Generator
) -> None:
    bayer = {"red": 0.3, "green": 0.5, "blue": 0.25, "white_balance": white_balance}
    spec = SensorSpec.model_validate({"bits": 12, "gamma": gamma, "bayer": bayer})
    sensor = image_sensor(spec, metered_exposure(spec, 0.35))
    frame = sensor.expose(np.full((300, 300), 0.35), random)
    peak = (
        0.7 if white_balance else sum(0.7 * WEIGHTS[c] * SIGNALS[c] ** (1 / gamma) for c in "rgb")
    )
    assert frame.mean() / 4095 == pytest.approx(peak, rel=2e-3)
