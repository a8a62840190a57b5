"""The clamp is solid, and hides nothing of the beam."""

import numpy as np
import pytest

from vbaa_bench.geometry.clamp import cable, flange, jaw, screw


def test_the_jaw_is_two_solid_halves_behind_the_beams_root() -> None:
    length, width, height, diameter = 14e-3, 9e-3, 7e-3, 0.8e-3
    mesh = jaw(length, width, height, diameter)
    assert mesh.is_watertight
    # Two prisms, less a gap of 0.6 diameters, less a frustum's missing rim c high.
    c = 0.12 * height
    top, area = (length - 2 * c) * (width - 2 * c), length * width
    rim = c * area - c / 3 * (area + 4 * (length - c) * (width - c) + top) / 2
    assert mesh.volume == pytest.approx(area * (height - 0.6 * diameter) - rim, rel=1e-9)
    low, high = mesh.bounds
    assert low == pytest.approx([-length, -width / 2, -height / 2])
    assert high == pytest.approx([0.0, width / 2, height / 2])
    # The beam's axis is in the gap.
    assert np.abs(mesh.vertices[:, 2]).min() == pytest.approx(0.3 * diameter)


def test_a_screw_has_a_hexagonal_socket() -> None:
    radius = 2e-3
    mesh = screw(radius, np.array([-7e-3, 0.0, 3.5e-3]))
    assert mesh.is_watertight
    full = np.pi * radius**2 * 1.1 * radius
    apothem = 0.5 * radius
    socket = 2 * np.sqrt(3) * apothem**2 * 0.6 * radius
    bevel = np.pi * radius * (0.12 * radius) ** 2
    assert mesh.volume == pytest.approx(full - socket - bevel, rel=0.01)
    assert mesh.bounds[:, 2] == pytest.approx([3.5e-3, 3.5e-3 + 1.1 * radius])


def test_flange_and_cable_are_solid() -> None:
    disc = flange(8e-3, 3e-3, -3.5e-3)
    assert disc.is_watertight
    assert disc.bounds[:, 2] == pytest.approx([-6.5e-3, -3.5e-3])
    assert disc.volume == pytest.approx(np.pi * 8e-3**2 * 3e-3, rel=0.02)
    line = cable(np.array([-14e-3, 0.0, -1.75e-3]), 13e-3, 0.144, 1e-3, -30e-3)
    assert line.is_watertight
    assert line.volume > 0
    assert line.bounds[0, 2] == pytest.approx(-30e-3, abs=1e-5)
    assert line.bounds[1, 0] == pytest.approx(-14e-3, abs=1e-4)
