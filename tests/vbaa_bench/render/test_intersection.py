"""Places where rays meet surfaces, against closed forms and Mitsuba's own."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from vbaa_bench.render.intersection import intersected
from vbaa_bench.render.loading import load
from vbaa_bench.render.variant import activate, is_scalar

# Of places, in the unit of the scene: single precision at coordinates of up to ten.
ROUNDING = 1e-5


def test_places_are_those_of_closed_forms_and_of_mitsuba(
    variant: str, random: np.random.Generator
) -> None:
    """A square sheet in z = 0, and a sphere, which is no mesh, beside it."""
    activate(variant, 1)
    if is_scalar():
        pytest.skip("traces one ray at a time")
    shift = mi.ScalarTransform4f().translate([5, 0, 0])
    sheet = {"type": "rectangle"}
    scene = load({"type": "scene", "sheet": sheet, "ball": {"type": "sphere", "to_world": shift}})
    x, y = (mi.Float(random.uniform(-2, 8, 4000).astype(np.float32)) for _ in range(2))
    ray = mi.Ray3f(mi.Point3f(x, y, 9), dr.normalize(mi.Vector3f(0.1, -0.2, -1)))
    active = mi.Bool((random.random(4000) < 0.9).tolist())
    si, own = intersected(scene, ray, active), scene.ray_intersect(ray, active)
    hit, p, shape, t = (np.array(one) for one in (si.is_valid(), si.p, si.shape, si.t))
    assert 100 < np.count_nonzero(hit) < 3000
    assert (hit == np.array(own.is_valid())).all()
    assert (shape == np.array(own.shape))[hit].all()
    assert np.abs(p[:, hit] - np.array(own.p)[:, hit]).max() < ROUNDING
    assert np.abs(t[hit] - np.array(own.t)[hit]).max() < ROUNDING
    assert not hit[~np.array(active)].any()
    on_sheet = hit & (np.abs(p[2]) < ROUNDING)
    on_ball = hit & (np.abs(np.linalg.norm(p - np.array([[5.0], [0.0], [0.0]]), axis=0) - 1) < 1e-4)
    assert on_sheet.any()
    assert on_ball.any()
    assert (on_sheet | on_ball)[hit].all()
    origin, along = np.array(ray.o), np.array(ray.d)
    meets = origin[:2] - origin[2] / along[2] * along[:2]
    assert np.abs(p[:2] - meets)[:, on_sheet].max() < ROUNDING
