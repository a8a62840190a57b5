"""Interpolated pixels, of which some are rendered: unbiased, and with the noise they state."""

import cv2
import numpy as np
import pytest

from solver.instrument.arrays import Floats, Mask
from tests.draws import scene_seed
from vbaa_bench.render.interpolated import Interpolated

SHAPE, SPACING = (64, 80), 4
NOISE = 0.05


def shadow() -> Floats:
    """A smooth shadow (height, width) with a small one of steep sides in it."""
    rows, columns = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]]
    steep = 3.0 * ((rows - 20) ** 2 + (columns - 30) ** 2 < 25)
    return np.asarray(-np.exp(-(((rows - 30) / 25) ** 2)) - steep)


def pilots(image: Floats, where: Mask, random: np.random.Generator) -> Interpolated:
    every = slice(None, None, SPACING)
    seen = (image + NOISE * random.standard_normal(SHAPE)).astype(np.float32)[every, every]
    return Interpolated.between(
        seen, where[every, every], np.full(seen.shape, 0.5, np.float32), SPACING, where
    )


def rendered(
    smooth: Interpolated, image: Floats, where: Mask, seed: int, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """Radiance and stated variance (n,) of the pixels in `where`."""
    rows, columns = np.nonzero(where)
    chosen = np.flatnonzero(smooth.chosen(rows, columns, scene_seed(seed)))
    radiance, variance = smooth.value.copy(), np.zeros(where.sum())
    seen = image[where][chosen] + NOISE * random.standard_normal(len(chosen))
    radiance[chosen], variance[chosen] = smooth.corrected(
        chosen, seen, np.full(len(chosen), NOISE**2)
    )
    return radiance, variance


@pytest.mark.thorough
def test_the_mean_is_the_image_and_the_variance_is_stated(random: np.random.Generator) -> None:
    image, where = shadow(), np.ones(SHAPE, np.bool_)
    where[:, 60:] = False
    images = []
    for seed in range(2000):
        smooth = pilots(image, where, random)
        images.append(rendered(smooth, image, where, seed, random))
    radiance, variance = np.array(images).transpose(1, 0, 2)
    error = (radiance.mean(axis=0) - image[where]) / (radiance.std(axis=0) / np.sqrt(2000))
    assert np.abs(error).max() < 5.5
    assert np.sqrt(np.mean(error**2)) < 1.1
    assert variance.mean() == pytest.approx(radiance.var(axis=0).mean(), rel=0.05)


def test_it_renders_few_pixels_where_it_is_smooth_and_all_at_edges(
    random: np.random.Generator,
) -> None:
    image, where = shadow(), np.ones(SHAPE, np.bool_)
    smooth = pilots(image, where, random)
    probability = smooth.probability.reshape(SHAPE)
    edge = cv2.dilate((image < -2).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert (probability[edge] == 1).all()
    assert np.median(probability) == 0.25
    rows, columns = np.nonzero(where)
    share = smooth.chosen(rows, columns, scene_seed(3))[smooth.probability == 0.25].mean()
    assert share == pytest.approx(0.25, abs=0.01)


def test_the_target_noise_is_reached(random: np.random.Generator) -> None:
    image, where = shadow(), np.ones(SHAPE, np.bool_)
    smooth = pilots(image, where, random)
    errors = [rendered(smooth, image, where, seed, random)[0] - image[where] for seed in range(200)]
    assert np.sqrt(np.mean(np.square(errors))) < 0.5
    assert np.quantile(np.std(errors, axis=0), 0.99) < 0.55


def test_pixels_without_pilots_around_them_are_rendered(random: np.random.Generator) -> None:
    image, where = shadow(), np.zeros(SHAPE, np.bool_)
    where[10:30, 10:12] = True
    assert (pilots(image, where, random).probability == 1).all()


def test_pixels_that_need_more_samples_are_rendered() -> None:
    smooth = Interpolated(np.zeros(3), np.full(3, 0.25))
    needed = smooth.rendered_if(np.array([True, False, True]))
    assert needed.probability.tolist() == [1, 0.25, 1]
