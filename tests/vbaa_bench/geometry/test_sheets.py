"""Lamps' irradiance against closed forms and against plain integration."""

import numpy as np
import pytest

from vbaa_bench.geometry.sheets import annulus, axes, between, irradiance, rectangle

UP = np.array([0.0, 0.0, 1.0])
X = np.array([1.0, 0.0, 0.0])


def test_a_ring_lights_its_axis_as_the_difference_of_two_discs() -> None:
    ring = annulus(np.array([0.1, 0.2, 0.36]), -UP, 0.035, 0.06)
    share = [r**2 / (r**2 + 0.36**2) for r in (0.035, 0.06)]
    got = irradiance(ring, np.array([0.1, 0.2, 0.0]), UP)
    assert got == pytest.approx(np.pi * (share[1] - share[0]), rel=1e-4)
    assert ring.area == pytest.approx(np.pi * (0.06**2 - 0.035**2), rel=1e-12)


def test_a_leaning_rectangle_brings_what_integration_over_it_says() -> None:
    middle, at = np.array([0.1, -0.3, 0.4]), np.array([0.02, 0.05, 0.01])
    ahead = at + np.array([0.01, 0.02, 0.0]) - middle
    panel = rectangle(middle, ahead, X, (0.3, 0.2))
    normal = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
    first, second, facing = axes(ahead, X)
    share = (np.arange(400) + 0.5) / 400 - 0.5
    u, v = (values.ravel()[:, None] for values in np.meshgrid(0.3 * share, 0.2 * share))
    way = middle + u * first + v * second - at
    distance = np.linalg.norm(way, axis=1)
    kernel = (way @ normal) * -(way @ facing) / distance**4
    assert irradiance(panel, at, normal) == pytest.approx(kernel.mean() * 0.06, rel=1e-5)


def test_a_lamp_is_dark_from_behind() -> None:
    panel = rectangle(np.array([0.0, 0.0, 1.0]), UP, X, (0.3, 0.2))
    assert irradiance(panel, np.zeros(3), UP) == 0
    assert panel.face_normals @ UP == pytest.approx(1)


def test_a_rectangle_keeps_its_first_side_along_the_beam() -> None:
    panel = rectangle(np.zeros(3), np.array([0.0, 1.0, -1.0]), X, (0.3, 0.2))
    assert np.ptp(panel.vertices, axis=0) == pytest.approx([0.3, 0.2 / 2**0.5, 0.2 / 2**0.5])
    # A lamp that shines along the beam has no such side: any will do.
    assert rectangle(np.zeros(3), X, X, (0.3, 0.2)).area == pytest.approx(0.06)


def test_a_lamp_hides_what_is_behind_it_alone() -> None:
    panel = rectangle(np.array([0.0, 0.0, 0.2]), -UP, X, (0.1, 0.1))
    start = np.array([0.0, 0.0, 0.3])
    # Through its middle; beside it; ending before it; along its plane; away from it.
    ends = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0, 0.25], [1, 0, 0.3], [0, 0, 0.5]], dtype=float)
    found = between(panel, np.broadcast_to(start, ends.shape), ends)
    assert found.tolist() == [True, False, False, False, False]
    ring = annulus(start, -UP, 0.035, 0.06)
    assert not between(ring, start[None], ends[:1]).any()  # through its hole
    beside = start + np.array([[0.045, 0.0, 0.1]])
    assert between(ring, beside, beside - [0, 0, 0.2]).all()
