import numpy as np
import pytest

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.tube import strip, tube

LENGTH = 0.2


def straight(n: int = 21) -> Floats:
    return np.column_stack([np.linspace(0, LENGTH, n), np.zeros(n), np.zeros(n)])


def bent(n: int = 400) -> Floats:
    """A quarter of a circle in the x-y plane."""
    angle = np.linspace(0, np.pi / 2, n)
    return LENGTH * np.column_stack([np.sin(angle), 1 - np.cos(angle), np.zeros(n)])


def across(path: Floats, turn: float | Floats = 0.0) -> Floats:
    """Unit vectors (n, 3) across `straight`, at `turn` [rad] from +y to +z."""
    turns = np.broadcast_to(turn, len(path))
    return np.column_stack([np.zeros(len(path)), np.cos(turns), np.sin(turns)])


def test_a_tapered_tube_is_a_stump_of_a_pyramid() -> None:
    facets, thick, thin = 12, 2e-3, 0.5e-3
    mesh = tube(straight(), np.linspace(thick, thin, 21), facets)
    assert mesh.is_watertight
    areas = facets / 2 * np.sin(2 * np.pi / facets) * np.array([thick**2, thick * thin, thin**2])
    assert mesh.volume == pytest.approx(LENGTH / 3 * areas.sum())


def test_an_even_taper_is_a_plain_tube() -> None:
    plain, even = tube(bent(), 1e-3, 12), tube(bent(), np.full(400, 1e-3), 12)
    assert (plain.vertices == even.vertices).all()


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_an_elliptic_tube_has_its_axes_along_and_across_the_director(turn: float) -> None:
    facets, first, aspect_ratio = 24, 1e-3, 0.25
    director = across(straight(), turn)
    mesh = tube(straight(), first, facets, director, aspect_ratio)
    assert mesh.is_watertight
    area = facets / 2 * np.sin(2 * np.pi / facets) * first * aspect_ratio * first
    assert mesh.volume == pytest.approx(area * LENGTH)
    assert (mesh.vertices @ director[0]).max() == pytest.approx(first)
    second = np.cross([1, 0, 0], director[0])
    assert (mesh.vertices @ second).max() == pytest.approx(aspect_ratio * first)


def test_a_twisting_director_turns_the_rings_and_keeps_them_across() -> None:
    path, turn = straight(), np.linspace(0, 2.0, 21)
    mesh = tube(path, 1e-3, 8, across(path, turn))
    rings = mesh.vertices[:-2].reshape(21, 8, 3) - path[:, None]
    assert rings[:, 0] == pytest.approx(1e-3 * across(path, turn))
    assert rings[..., 0] == pytest.approx(0, abs=1e-15)


def test_a_circular_tube_with_the_frames_director_is_a_plain_tube() -> None:
    path = bent()
    angle = np.linspace(0, np.pi / 2, len(path))
    director = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(len(path))])
    assert tube(path, 1e-3, 8, director).vertices == pytest.approx(
        tube(path, 1e-3, 8).vertices, abs=1e-12
    )


def test_a_strip_has_its_thickness_along_the_director() -> None:
    mesh = strip(straight(), across(straight()), 0.5e-3, 8e-3)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(0.5e-3 * 8e-3 * LENGTH)
    assert mesh.extents == pytest.approx([LENGTH, 0.5e-3, 8e-3])


def test_a_bent_strip_has_the_volume_of_its_centreline() -> None:
    path = bent()
    angle = np.linspace(0, np.pi / 2, len(path))
    director = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(len(path))])
    mesh = strip(path, director, 2e-3, 8e-3)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(2e-3 * 8e-3 * LENGTH * np.pi / 2, rel=1e-4)
    radii = np.hypot(mesh.vertices[:-2, 0], mesh.vertices[:-2, 1] - LENGTH)
    assert np.abs(radii - LENGTH) == pytest.approx(1e-3, rel=1e-4)
