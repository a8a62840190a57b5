"""Samples stratified by the beam's silhouette: unbiased even by a wrong one, and less noisy."""

from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.consistency import MOST_SIGMAS
from tests.draws import scene_seed
from tests.vbaa_bench.render.test_thin_beams import CAMERA, beam, world_before
from vbaa_bench.render.silhouette import Silhouette
from vbaa_bench.render.tracing import Traced, trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World

PLACES = ((0.6, 0.0), (30.0, 0.2), (90.0, 0.3))
SETS = 64


@pytest.fixture(scope="module")
def world(variant: str) -> World:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts whole images are rendered")
    return world_before(CAMERA)


def around(silhouette: Silhouette) -> np.ndarray:
    """The pixels (n, 2) that the silhouette touches, and their neighbours."""
    touched = silhouette.touched
    for axis in (0, 1):
        touched = touched | np.roll(touched, 1, axis) | np.roll(touched, -1, axis)
    rows, columns = np.nonzero(touched)
    return np.column_stack([columns, rows])


def traced(world: World, pixels: np.ndarray, silhouette: Silhouette | None, seed: int) -> Traced:
    vars(world)["silhouette"] = silhouette
    return trace(world, pixels, np.full(len(pixels), 8), scene_seed(seed), "whole", SETS)


@pytest.mark.thorough
@pytest.mark.parametrize("width_px", [0.3, 1.6])
@pytest.mark.parametrize(("angle_deg", "shift_px"), PLACES)
def test_its_overlap_is_what_the_beam_covers(
    world: World, width_px: float, angle_deg: float, shift_px: float
) -> None:
    world.move({"beam": beam(width_px, angle_deg, shift_px)})
    silhouette = world.silhouette
    assert silhouette is not None
    assert silhouette.upright == (angle_deg > 45)
    pixels = around(silhouette)
    vars(world)["silhouette"] = None
    coverage = trace(world, pixels, np.full(len(pixels), 512), scene_seed(1), "whole", 16).coverage
    columns, rows = pixels.T if silhouette.upright is False else pixels.T[::-1]
    place = np.linspace(0, 1, 21)[:, None, None]
    left, right = silhouette.edges[:2, columns], silhouette.edges[2:, columns]
    lower, upper = np.clip((left + place * (right - left) - rows).transpose(1, 0, 2), 0, 1)
    # The beam ends, obliquely, within the first two and the last two columns.
    shown = np.flatnonzero(silhouette.edges.any(axis=0))
    inner = (columns > shown[1]) & (columns < shown[-2])
    error = ((upper - lower).mean(axis=0) - coverage)[inner]
    assert np.abs(error).max() < 0.012
    touched = silhouette.touched[pixels[:, 1], pixels[:, 0]]
    assert (coverage[~touched] == 0).all()


@pytest.mark.thorough
@pytest.mark.parametrize("shift_px", [0.0, 0.2, -0.6, 5.0])
def test_the_mean_does_not_depend_on_the_silhouette(world: World, shift_px: float) -> None:
    world.move({"beam": beam(0.8, 30.0, 0.2)})
    right = world.silhouette
    assert right is not None
    pixels = around(right)
    shifted = replace(right, edges=right.edges + shift_px * (right.edges != 0))
    images = [
        [traced(world, pixels, silhouette, 100 * seed) for seed in range(16)]
        for silhouette in (None, shifted)
    ]
    for quantity in ("radiance", "coverage"):
        one, other = (
            np.array([getattr(image, quantity).sum() for image in series]) for series in images
        )
        error = np.hypot(one.std(ddof=1), other.std(ddof=1)) / np.sqrt(len(one))
        assert abs(one.mean() - other.mean()) < MOST_SIGMAS * error
        assert error < 2e-3 * one.mean()


@pytest.mark.parametrize(
    ("angle_deg", "shift_px", "largest"), [(0.6, 0.0, 0.25), (30.0, 0.2, 0.75), (90.0, 0.3, 0.25)]
)
def test_the_covered_fraction_varies_less(
    world: World, angle_deg: float, shift_px: float, largest: float
) -> None:
    """Of an oblique beam, the covered length also varies along a pixel."""
    world.move({"beam": beam(0.5, angle_deg, shift_px)})
    right = world.silhouette
    assert right is not None
    rows, columns = np.nonzero(right.touched)
    inner = ~right.ends[rows if right.upright else columns]
    pixels = np.column_stack([columns, rows])[inner]
    size = np.full(len(pixels), 8)

    def spread(silhouette: Silhouette | None) -> float:
        vars(world)["silhouette"] = silhouette
        images = [
            trace(world, pixels, size, scene_seed(seed), "whole").coverage for seed in range(16)
        ]
        return float(np.sqrt(np.var(images, axis=0, ddof=1).mean()))

    assert spread(right) < largest * spread(None)


def arc(angle_deg: float) -> Floats:
    """Rings (n, 4, 3) [m] of a beam bent to an arc of a circle in plane C."""
    angle = np.radians(np.linspace(0, angle_deg, 40))
    line = np.column_stack([0.115 + 0.006 * np.sin(angle), 0.006 * (1 - np.cos(angle)), 0 * angle])
    normal = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    up = np.array([0.0, 0.0, 1.0])
    sides = np.stack([normal, np.broadcast_to(up, normal.shape), -normal, -up + 0 * normal], axis=1)
    return np.asarray(line[:, None] + 2e-4 * sides)


def test_a_beam_that_turns_back_has_none() -> None:
    assert Silhouette.of(arc(60.0), CAMERA) is not None
    assert Silhouette.of(arc(60.0)[::-1], CAMERA) is not None
    assert Silhouette.of(arc(170.0), CAMERA) is None
