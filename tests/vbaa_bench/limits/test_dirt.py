"""Dirt in the limits: without any, the profile's own information; with it, closed forms."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from tests.vbaa_bench.limits.experiments import push
from vbaa_bench.api.scene import Scene
from vbaa_bench.limits.dirt import dirt_of, information_through_dirt
from vbaa_bench.limits.profile import BRIGHTNESS, SHIFT, SurfaceProfile, gray_profile, information
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.rigs import true_rig

PARTS = 16
PUSHES = {"contact_distance_mm": [140], "deflection_pct": [10]}
ACROSS_ROWS = np.array([0.0, 1.0])
DISC = np.sqrt(1 - ((np.arange(PARTS) + 0.5) / (PARTS / 2) - 1) ** 2)
SURFACE = SurfaceProfile(DISC, 0.1, 1.3, ACROSS_ROWS, 0.4, diffuse=DISC)


def steady(mean: Floats) -> Floats:
    """Noise with the same variance in all pixels."""
    return np.full_like(mean, 0.01)


def test_without_dirt_the_information_is_that_of_the_profile() -> None:
    nothing = information_through_dirt(SURFACE, steady, np.zeros((PARTS, PARTS)))
    # Eight places of a pixel against a continuous range.
    np.testing.assert_allclose(nothing, information(SURFACE, steady), rtol=0.02, atol=0.02)


def test_dirt_as_noise_of_the_brightness_adds_its_variance_to_that_of_the_brightness() -> None:
    """A change of the whole width has the image of the brightness: (1 / I + P)^-1."""
    density = 0.04 * np.outer(DISC, DISC)
    clean, dirty = information(SURFACE, steady), information_through_dirt(SURFACE, steady, density)
    expected = 1 / (1 / clean[BRIGHTNESS, BRIGHTNESS] + 0.04)
    assert dirty[BRIGHTNESS, BRIGHTNESS] == pytest.approx(expected, rel=0.02)
    assert dirty[SHIFT, SHIFT] == pytest.approx(clean[SHIFT, SHIFT], rel=0.02)


def test_dirt_that_looks_like_a_shift_hides_it() -> None:
    """Changes that are odd across the width look like a shift, but for the noise's share."""
    tilted = DISC * np.linspace(-1, 1, PARTS)
    clean = information(SURFACE, steady)[SHIFT, SHIFT]
    limits = []
    for variance in (1e-4, 1e-2, 1.0):
        density = variance * np.outer(tilted, tilted)
        limits.append(information_through_dirt(SURFACE, steady, density)[SHIFT, SHIFT])
    assert clean > limits[0] > limits[1] > limits[2]
    assert limits[2] < 0.2 * clean  # a tilt of the light is not exactly the slope of the profile
    # A saturated pixel shows nothing, and is no error.
    peak = gray_profile(SURFACE).mean.max()
    saturated = information_through_dirt(
        SURFACE, lambda mean: np.where(mean < 0.99 * peak, 0.01, np.inf), np.zeros((PARTS, PARTS))
    )
    assert 0 < saturated[SHIFT, SHIFT] < clean


@pytest.mark.thorough
def test_the_density_of_a_drawn_pattern_is_that_of_its_field() -> None:
    """The correlation exp(-r / a) has the density 2 a / (1 + (2 pi f a)^2) along the beam."""
    grime = {"smudge_contrast": 0.2, "smudge_mm": 2.0, "dust_mm": 0.5, "uneven_gloss": 0.0}
    beam = {"diameter_mm": 12, "reflectance": 0.4, "grime": grime}
    length_px = 480.0
    a, frequencies = 2.0 / 240 * length_px, np.arange(1, 5) / length_px
    expected = 0.2**2 * np.mean(2 * a / (1 + (2 * np.pi * frequencies * a) ** 2))
    ratios = []
    for number in range(6):
        scene = Scene(title="Dirt", seed=scene_seed(number), pushes=PUSHES, beam=beam).scene
        dirt = dirt_of(scene, true_rig(scene), PARTS)
        assert dirt is not None
        assert dirt.mean_diffuse == pytest.approx(1.0, abs=0.03)
        assert dirt.mean_specular == 1.0
        density = dirt.density(SURFACE, length_px) / np.outer(DISC, DISC)
        ratios.append(np.diag(density).mean() / expected)
    # Over 30 patterns 1.06 +- 0.11 each.
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.31)


@pytest.mark.thorough
def test_a_clean_beam_has_none_and_a_dirty_one_a_larger_limit(variant: str) -> None:
    activate(variant, 1)
    clean_scene = Scene(title="Clean", seed=scene_seed(1), pushes=PUSHES).scene
    assert dirt_of(clean_scene, true_rig(clean_scene), PARTS) is None
    clean = push()[0]
    grime = {"smudge_contrast": 0.2, "smudge_mm": 5, "dust_pct": 0, "uneven_gloss": 0}
    same = push(beam={"grime": grime})[0]
    contrast = {"uniform": [0.2, 0.20001], "per": "push"}
    new = push(beam={"grime": {**grime, "smudge_contrast": contrast}})[0]
    limits = [dict(frame.by_set())["planar"][0] for frame in (clean, same, new)]
    # A pattern that the rest images show is neglected.
    assert limits[1] == pytest.approx(limits[0], rel=0.05)
    assert 1.05 < limits[2] / limits[0] < 10
