"""Images and procedural textures of surfaces."""

from pathlib import Path

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
import trimesh
from scipy.stats import norm

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from vbaa_bench.geometry.textures import Texture, box_mapped, image_texture, unshared
from vbaa_bench.render.image_files import read_surface_image
from vbaa_bench.render.materials import bsdf
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.textures.speckle import speckle_texture


def looked_up(texture: Texture) -> Floats:
    bitmap = mi.load_dict(bsdf("matt", 0.0, 0.3, texture)["bsdf"]["reflectance"])
    values = []
    for u, v in texture.uv:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.uv = mi.Point2f(float(u), float(v))
        values.append(float(np.ravel(bitmap.eval_1(si))[0]))
    return np.array(values)


def test_an_image_is_upright_and_as_wide_as_stated(variant: str) -> None:
    activate(variant, 2)
    # Top left, top right; bottom left, bottom right, in texels of 10 mm.
    image = np.array([[0.1, 0.2], [0.3, 0.4]])
    places = np.array([[-5, 5], [5, 5], [-5, -5], [5, -5], [15, 5], [0, 0]]) * 1e-3
    found = looked_up(image_texture(places, image, 1.0, 0.020))
    assert found == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.1, 0.25], rel=1e-5)


def test_gray_values_are_decoded(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "two.png"), np.array([[188, 0]], np.uint8))
    # An encoded value of 188 is half the light of 255 (IEC 61966-2-1).
    assert read_surface_image(tmp_path, "two.png") == pytest.approx(np.array([[2.0, 0.0]]))
    three = np.array([[255, 188, 0]], np.uint8)
    cv2.imwrite(str(tmp_path / "three.png"), three)
    found = read_surface_image(tmp_path, "three.png")
    assert found[0, 1] / found[0, 0] == pytest.approx(0.5, abs=0.005)
    header = {"type": OpenEXR.scanlineimage}
    values = np.array([[1.0, 3.0]], np.float32)
    with OpenEXR.File(header, {"Y": values}) as file:
        file.write(str(tmp_path / "two.exr"))
    assert read_surface_image(tmp_path, "two.exr") == pytest.approx(np.array([[0.5, 1.5]]))


def test_files_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    inside = tmp_path / "scenes"
    inside.mkdir()
    cv2.imwrite(str(tmp_path / "secret.png"), np.full((4, 4), 200, np.uint8))
    cv2.imwrite(str(inside / "black.png"), np.zeros((4, 4), np.uint8))
    (inside / "text.png").write_text("no image")
    (inside / "link.png").symlink_to(tmp_path / "secret.png")
    for name, message in (
        ("../secret.png", "is outside of the scene's folder"),
        (str(tmp_path / "secret.png"), "is outside of the scene's folder"),
        ("link.png", "is outside of the scene's folder"),
        ("black.png", "is black"),
        ("text.png", "is not an image"),
        ("none.png", "none.png"),
        ("none.exr", "none.exr"),
    ):
        with pytest.raises(InputError, match=message):
            read_surface_image(inside, name)


def test_speckles_cover_their_share(random: np.random.Generator) -> None:
    image = speckle_texture(np.zeros((3, 2)), (0.6, 0.1), 1e-3, 0.3, 0.04, random).image
    assert set(np.unique(image)) == {0.6, 0.1}
    assert (image == 0.1).mean() == pytest.approx(0.3, abs=1e-4)
    # Crossings of a level by a Gaussian field of this correlation (Rice 1944), per length.
    sigma, level = 1e-3 / 3, norm.ppf(0.3)
    crossings = np.exp(-(level**2) / 2) / (np.pi * np.sqrt(2) * sigma)
    changes = (np.diff(image, axis=1) != 0).sum(axis=1).mean() / 0.04
    assert changes == pytest.approx(crossings, rel=0.12)


def test_every_side_of_a_body_has_its_own_coordinates() -> None:
    body = trimesh.creation.box(extents=(2.0, 4.0, 6.0))
    apart, places = unshared(body), box_mapped(body)
    assert apart.volume == pytest.approx(body.volume)
    assert len(apart.vertices) == len(places) == 3 * len(body.faces)
    # No face is stretched: its area on the sheet is that in space.
    corners = places.reshape(-1, 3, 2)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    assert areas == pytest.approx(body.area_faces)
