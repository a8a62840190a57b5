"""photos.json: what it may contain, and one clear sentence for each mistake."""

import json
import math
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.instrument.beam_shape import SECTION_SIGMA
from solver.instrument.errors import InputError
from solver.photographs.photo_set import LENS, PhotoLoad, Stated
from solver.photographs.photos_json import FILE, read_photos

DOCUMENT: dict[str, Any] = {
    "beam": {
        "length_mm": 400,
        "length_sigma_mm": 0.5,
        "flexural_rigidity_n_mm2": 50000,
        "flexural_rigidity_sigma_n_mm2": 10000,
    },
    "beam_shape": {"taper_sigma": 0.02, "clamp_softness_sigma": 0.01},
    "channel": "lab_b",
    "camera": {
        "focal_length_px": 3000,
        "focal_length_sigma_px": 300,
        "view_sigma_deg": 4,
        "k1": -0.01,
        "k1_sigma": 0.02,
    },
    "mark_sigma_px": 1.5,
    "down_deg": -90,
    "down_sigma_deg": 1,
    "clamp_tilt_sigma_deg": 2,
    "photos": [
        {"file": "rest_0.jpg", "clamp_px": [812.0, 1403.5], "tip_px": [3551, 1390]},
        {
            "file": "load_0.jpg",
            "clamp_px": [800.0, 1400.0],
            "tip_px": [3500.0, 1700.0],
            "marks": [{"px": [10, 20], "mm": [0, -60]}],
            "ticks": [{"px": [2000, 1500], "at_mm": 200, "at_sigma_mm": 1}],
            "tip_hidden": True,
            "principal_point_px": [2016, 900.5],
            "load": {
                "kind": "weight",
                "force_n": 1.2,
                "force_sigma_n": 0.002,
                "at_mm": 300,
                "at_sigma_mm": 1,
            },
        },
    ],
}


def written(folder: Path, document: Any) -> Path:
    (folder / FILE).write_text(json.dumps(document), encoding="utf-8")
    return folder


def test_everything_stated_is_read_in_si_units(tmp_path: Path) -> None:
    photos = read_photos(written(tmp_path, DOCUMENT))
    rest, loaded = photos.photographs
    assert rest.path == tmp_path / "rest_0.jpg"
    assert rest.load is None
    assert rest.marks.shape == (0, 4)
    assert np.array_equal(rest.clamp, [812.0, 1403.5])
    assert loaded.load == PhotoLoad("weight", Stated(1.2, 0.002), Stated(0.3, 0.001))
    assert loaded.marks == pytest.approx(np.array([[10, 20, 0, -0.06]]))
    assert photos.length == pytest.approx((0.4, 5e-4))
    assert photos.rigidity == pytest.approx((0.05, 0.01))
    assert photos.focal == (3000.0, 300.0)
    assert photos.k1 == (-0.01, 0.02)
    assert loaded.ticks == pytest.approx(np.array([[2000, 1500, 0.2, 0.001]]))
    assert (rest.tip_hidden, loaded.tip_hidden) == (False, True)
    assert rest.principal_point is None
    assert loaded.principal_point is not None
    assert np.array_equal(loaded.principal_point, [2016, 900.5])
    angles = [*photos.down, photos.view_sigma, photos.tilt_sigma]
    assert angles == pytest.approx(np.radians([-90, 1, 4, 2]))
    assert (photos.mark_sigma, photos.channel) == (1.5, "lab_b")
    assert len(photos.shape.widths) == 1


def test_what_is_not_stated_has_a_default(tmp_path: Path) -> None:
    document = {"beam": {"length_mm": 400, "length_sigma_mm": 0}, "photos": DOCUMENT["photos"][:1]}
    photos = read_photos(written(tmp_path, document))
    assert photos.rigidity is None
    assert photos.focal is None
    assert photos.k1 == LENS
    assert photos.channel == "all"
    assert photos.view_sigma == pytest.approx(math.radians(5))
    assert photos.shape.section_sigma == SECTION_SIGMA


def _mistake(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    document = deepcopy(DOCUMENT)
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["beam"].pop("length_mm"), "the key beam.length_mm is missing"),
        (lambda d: d.update(chanel="r"), "the key chanel is unknown"),
        (
            lambda d: d["photos"][1]["load"].update(mass_g=3),
            "the key photos.1.load.mass_g is unknown",
        ),
        (lambda d: d["photos"][1]["marks"][0].pop("mm"), "photos.1.marks.0.mm is missing"),
        (lambda d: d["photos"][1]["load"].update(kind="pull"), "allowed is one of weight, push"),
        (lambda d: d["photos"][1]["load"].update(at_mm=401), "a number from 0 to 400"),
        (lambda d: d["photos"][1]["load"].pop("force_sigma_n"), "force_sigma_n is missing"),
        (
            lambda d: d["photos"][1]["load"].update(force_N=d["photos"][1]["load"].pop("force_n")),
            "photos.1.load.force_n is missing",
        ),
        (lambda d: d.update(camera=[3000]), "camera is .3000., allowed is a section"),
        (lambda d: d["photos"][0].update(clamp_px=[1]), "a list of two numbers"),
        (lambda d: d["photos"][0].update(tip_px=[812, 1404]), "at least 50 px from clamp_px"),
        (lambda d: d["photos"][0].update(file="../a.jpg"), "a file in the same folder"),
        (lambda d: d["photos"][1].update(file="rest_0.jpg"), "a file that no other photo has"),
        (lambda d: d.update(photos=[]), "a list of 1 to 200 sections"),
        (lambda d: d.update(photos=[3]), "a list of 1 to 200 sections"),
        (lambda d: d.update(down_deg=5), "across the beam"),
        (lambda d: d.pop("down_deg"), "the key down_deg is missing"),
        (lambda d: d.update(mark_sigma_px=0), "mark_sigma_px is 0"),
        (lambda d: d["camera"].pop("k1"), "camera.k1 is missing"),
        (lambda d: d["photos"][1].pop("ticks"), "tip_hidden is True, allowed is false without"),
        (lambda d: d["photos"][1]["ticks"][0].update(at_mm=401), "a number from 0 to 400"),
    ],
)
def test_a_mistake_gets_one_sentence(
    change: Callable[[dict[str, Any]], object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message) as refused:
        read_photos(written(tmp_path, _mistake(change)))
    assert str(tmp_path / FILE) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_folder_without_photos_json_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_photos(tmp_path)
