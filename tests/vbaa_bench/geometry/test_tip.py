"""Tips keep the beam's length, and every vertex its arc length."""

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import generator
from vbaa_bench.geometry.tip import TIPS, Tip, shaped
from vbaa_bench.geometry.tube import arc_length_of_vertices, normals, tube

RADIUS, LENGTH, FACETS = 0.4e-3, 0.24, 32


def straight(shape: Tip) -> tuple[Floats, Floats, float]:
    """Vertices, arc lengths and volume of a straight beam along x."""
    tip = TIPS[shape]
    end = tip.rings(RADIUS)
    s = np.append(np.linspace(0, LENGTH - end.before_end[0], 50)[:-1], LENGTH - end.before_end)
    radius = np.full(len(s), RADIUS)
    radius[-len(end.factor) :] *= end.factor
    path = np.column_stack([s, np.zeros((len(s), 2))])
    mesh = tube(path, radius, FACETS, caps_apart=True)
    arc_length = arc_length_of_vertices(s, FACETS)
    arc_length = shaped(mesh, arc_length, FACETS, tip, generator(__name__, 2))
    mesh.merge_vertices()
    assert mesh.is_watertight
    unmerged = tube(path, radius, FACETS, caps_apart=True)
    shaped(unmerged, arc_length, FACETS, tip, generator(__name__, 2))
    return np.asarray(unmerged.vertices), arc_length, float(mesh.volume)


@pytest.mark.parametrize(
    ("shape", "missing"),
    # Over pi r^3: a half ball in place of a cylinder; half a cylinder 2 r long; a lip adds some.
    [("round", 1 / 3), ("cut", 1.0), ("burr", -0.1)],
)
def test_a_tip_ends_where_the_beam_ends(shape: Tip, missing: float) -> None:
    vertices, arc_length, volume = straight(shape)
    assert vertices[:, 0].max() == pytest.approx(LENGTH, abs=0.01 * RADIUS)
    # On a straight beam arc length is x.
    assert arc_length == pytest.approx(vertices[:, 0], abs=1e-12)
    polygon = FACETS / 2 * np.sin(2 * np.pi / FACETS)
    lost = LENGTH * polygon * RADIUS**2 - volume
    assert lost / (np.pi * RADIUS**3) == pytest.approx(missing, abs=0.06)


def test_a_cut_is_lit_as_the_plane_it_is() -> None:
    vertices, _, _ = straight("cut")
    found = normals(vertices, FACETS, oblique_tip=True)
    assert np.linalg.norm(found, axis=1) == pytest.approx(1)
    cap, plane = found[-2 - FACETS : -2], vertices[-2 - FACETS : -2]
    assert cap[:, 0] == pytest.approx(np.sqrt(0.5))
    # It is across every chord of the cut.
    assert (plane - plane[0]) @ cap[0] == pytest.approx(0, abs=1e-12)
