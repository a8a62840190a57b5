"""Textures of beam and object have the reflectance of their paint."""

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.part_textures import beam_texture, object_texture
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import TrueRig, true_rig
from vbaa_bench.scene.schema import Scene


def rig_of(folder: Path, extra: str) -> tuple[Scene, TrueRig]:
    path = folder / "scene.yaml"
    path.write_text(SMALL_SCENE + extra, encoding="utf-8")
    scene = load_scene(path).scene
    return scene, true_rig(scene)


@pytest.mark.parametrize(("paint", "mean"), [("gloss", 0.6), ("black", 0.03)])
def test_a_grimy_beam_keeps_its_paint(paint: str, mean: float, tmp_path: Path) -> None:
    extra = f"beam: {{paint: {paint}, reflectance: 0.6, grime: {{dust_pct: 0}}}}"
    texture = beam_texture(*rig_of(tmp_path, extra))
    assert texture is not None
    assert texture.image.mean() == pytest.approx(mean, rel=0.05)
    # Its coordinates are arc lengths: one period is the whole beam.
    assert texture.per_mm == pytest.approx(1 / 240)
    assert beam_texture(*rig_of(tmp_path, "")) is None


@pytest.mark.parametrize("kind", ["pad", "sphere", "block", "knife_edge"])
def test_a_texture_has_a_place_for_every_corner(kind: str, tmp_path: Path) -> None:
    extra = f"object: {{kind: {kind}, reflectance: 0.3, paint: bare, texture: {{kind: brushed}}}}"
    texture = object_texture(*rig_of(tmp_path, extra), tmp_path)
    assert texture is not None
    assert len(texture.uv) % 3 == 0
    assert np.isfinite(texture.uv).all()
    # Steel shines by its gloss, on average by 80 % of that of clean iron.
    assert texture.gloss is not None
    assert texture.gloss.mean() == pytest.approx(0.8, rel=0.08)
    assert texture.gloss.max() <= 1
