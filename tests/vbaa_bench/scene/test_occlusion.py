"""Bodies that hide the beam are closed, thin, and where they should be."""

import numpy as np
import pytest
import trimesh

from tests.draws import generator
from vbaa_bench.scene.occlusion import LEAF_WIDTH, MAX_TILT, Area, Bars, Leaves, Opaque

AREA = Area(0.05, 0.11, -0.02, 0.03, 0.006)


def bodies(mesh: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    return list(mesh.split(only_watertight=False))


def test_a_sheet_covers_its_rectangle_at_its_height() -> None:
    mesh = Opaque().mesh(AREA, 1.0, 1, generator(__name__))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.06 * 0.05 * 0.2e-3)
    assert mesh.bounds == pytest.approx(np.array([[0.05, -0.02, 0.006], [0.11, 0.03, 0.0062]]))


def test_bars_are_evenly_spread_and_run_along_y() -> None:
    mesh = Bars().mesh(AREA, 1 / 6, 5, generator(__name__))
    assert mesh.is_watertight
    each = bodies(mesh)
    assert len(each) == 5
    assert all(bar.volume == pytest.approx(0.999 * 2e-3 * 0.05 * 0.2e-3) for bar in each)
    middles = sorted(bar.centroid[0] for bar in each)
    assert middles == pytest.approx([0.056, 0.068, 0.08, 0.092, 0.104])


def test_bars_that_hide_all_are_apart() -> None:
    assert len(bodies(Bars().mesh(AREA, 1.0, 5, generator(__name__)))) == 5


def test_bars_take_twice_the_stretch_where_there_is_room() -> None:
    assert Bars().spread(0.10, 0.14, 0.24) == pytest.approx((0.08, 0.16))
    assert Bars().spread(0.0, 0.04, 0.24) == pytest.approx((0.0, 0.08))
    assert Bars().spread(0.04, 0.24, 0.24) == pytest.approx((0.0, 0.24))


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
def test_leaves_are_closed_thin_and_where_they_should_be(random: np.random.Generator) -> None:
    mesh = Leaves().mesh(AREA, 1.0, 40, random)
    size = 0.025  # half the area's extent across the beam
    assert mesh.is_watertight
    each = bodies(mesh)
    assert len(each) == 40
    area = 2 / np.pi * LEAF_WIDTH * size**2  # of two arches of a sine
    for leaf in each:
        assert leaf.volume == pytest.approx(area * 0.2e-3, rel=0.01)
        x, y, z = leaf.center_mass
        assert (0.05 <= x <= 0.11, -0.02 <= y <= 0.03) == (True, True)
        assert z == pytest.approx(0.006)
        assert leaf.bounds[0, 2] > 0.006 - size / 2 * np.sin(MAX_TILT) - 0.1e-3
    assert np.ptp([leaf.extents[0] for leaf in each]) > 0.3 * size  # they head anywhere


def test_leaves_depend_on_their_random_numbers_alone() -> None:
    one, same, other = (
        Leaves().mesh(AREA, 1.0, 4, generator(__name__, seed)) for seed in (1, 1, 2)
    )
    assert (one.vertices == same.vertices).all()
    assert np.abs(one.vertices - other.vertices).max() > 1e-3
