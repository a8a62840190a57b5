import numpy as np
import pytest

from solver.centreline.area_weighted import area_weighted
from solver.instrument.arrays import Floats, Grey
from tests.draws import generator


def line_image(rows: Floats, width: float, height: int = 64, noise: float = 0.0) -> Grey:
    """A bright line of `width` px about `rows`, box-integrated over the pixels, on gray 10."""
    v = np.arange(height)[:, None]
    low = np.maximum(rows - width / 2, v - 0.5)
    high = np.minimum(rows + width / 2, v + 0.5)
    cover = np.clip(high - low, 0, 1)
    gray = 10 + 168 * cover + noise * generator(__name__, 0).standard_normal(cover.shape)
    return np.asarray(np.clip(np.rint(gray), 0, 255), dtype=np.uint8)


def test_follows_a_tilted_line_within_its_sigma() -> None:
    u = np.arange(200)
    rows = 20 + 0.07 * u + 1e-4 * u**2
    found = area_weighted(line_image(rows, 1.6, noise=1.0))
    assert found.points[:, 0] == pytest.approx(u)
    error = found.points[:, 1] - rows
    assert np.sqrt(np.mean(error**2)) < 1.4 * np.median(found.sigma)
    assert abs(error.mean()) < 0.01


def test_the_sigma_grows_with_the_noise() -> None:
    rows = np.full(100, 30.3)
    quiet = area_weighted(line_image(rows, 3.0, noise=0.5)).sigma.mean()
    loud = area_weighted(line_image(rows, 3.0, noise=8.0)).sigma.mean()
    assert loud > 1.2 * quiet


def test_a_line_drawn_without_noise_or_flanks_has_a_sigma() -> None:
    image = np.zeros((64, 100), np.uint8)
    image[30] = 200
    line = area_weighted(image)
    assert line.points[:, 1] == pytest.approx(np.full(100, 30.0))
    assert (line.sigma > 0).all()


def test_columns_without_the_beam_are_absent() -> None:
    image = line_image(np.full(100, 30.0), 1.6)
    image[:, 40:60] = 10
    image[:, :5] = 10
    seen = area_weighted(image).points[:, 0]
    assert not np.isin(np.r_[0:5, 40:60], seen).any()
    assert np.isin(np.r_[5:40, 60:100], seen).sum() >= 40  # the longest stretch at the least


def test_a_dark_block_beside_the_beam_does_not_pull() -> None:
    rows = np.full(100, 30.4)
    image = line_image(rows, 1.6)
    image[32:50, 45:60] = np.maximum(image[32:50, 45:60], 35)
    error = area_weighted(image).points[:, 1] - 30.4
    assert np.abs(error).max() < 0.2


@pytest.mark.parametrize("gray", [0, 255])
def test_an_even_image_shows_no_beam(gray: int) -> None:
    assert len(area_weighted(np.full((40, 60), gray, np.uint8)).points) == 0


def test_noise_shows_no_beam(random: np.random.Generator) -> None:
    image = random.normal(40, 5, (64, 96)).clip(0, 255).astype(np.uint8)
    assert len(area_weighted(image).points) < 5
