"""A preset adds keys, and the scene's own keys win."""

from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from tests.conftest import SMALL_SCENE
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.presets import PRESETS
from vbaa_bench.scene.schema import Scene


def scene(folder: Path, extra: str) -> Scene:
    path = folder / "scene.yaml"
    path.write_text(SMALL_SCENE + extra, encoding="utf-8")
    return load_scene(path).scene


def test_a_look_is_its_keys(tmp_path: Path) -> None:
    plain, looking = scene(tmp_path, ""), scene(tmp_path, "look: laboratory\n")
    assert (plain.look, plain.clamp, plain.clutter, plain.ambient) == (None,) * 4
    keys = plain.model_dump(exclude_unset=True)
    spelt_out = Scene.model_validate({**keys, **PRESETS["laboratory"]})
    assert looking.model_copy(update={"look": None}) == spelt_out
    assert spelt_out != plain


def test_own_keys_win(tmp_path: Path) -> None:
    extra = """look: laboratory
clutter: null
optics: {vignetting_pct: 5}
background: {pattern: squares}
beam: {diameter_mm: 1, grime: {dust_pct: 0}}
"""
    own = scene(tmp_path, extra)
    assert own.clutter is None
    assert (own.optics.vignetting_pct, own.optics.point_spread_px) == (5, 0.5)
    assert (own.background.pattern, own.background.reflectance) == ("squares", 0.2)
    assert own.beam.grime is not None
    assert (own.beam.diameter_mm, own.beam.grime.dust_pct) == (1, 0)
    assert own.clamp is not None
    # What is written to a dataset's manifest makes the same scene.
    assert Scene.model_validate_json(own.model_dump_json(), strict=False) == own


def test_an_unknown_look_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="look is 'labratory', allowed is one of laboratory"):
        scene(tmp_path, "look: labratory\n")
