import json
import math
import os
from copy import deepcopy
from dataclasses import asdict, replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from solver.instrument.board import Board, Charuco, Chessboard, LineNetwork
from solver.instrument.errors import InputError
from solver.instrument.rig import ANY_LIGHT, Gravity, Light, Sensors
from solver.instrument.rig_json import read_rig, rig_to_json
from solver.instrument.rig_keys import ENCODER_SIGMA_DEG, KEYS, TIP_SIGMA_RADII
from tests.draws import scene_seed
from tests.simulated import rig


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    path.write_text(rig_to_json(rig(beam_length=1e-4, encoder=1e-3)))
    found = read_rig(path)
    assert rig_to_json(found) == path.read_text()
    assert found.beam.length == rig().beam.length
    assert found.beam.flexural_rigidity == pytest.approx(rig().beam.flexural_rigidity, rel=1e-11)
    assert found.tolerances.encoder == pytest.approx(1e-3, rel=1e-11)
    assert found.antenna_from_board == pytest.approx(np.eye(4))


def test_the_readme_describes_every_key_that_a_laboratory_states() -> None:
    text = (Path(__file__).parents[3] / "solver" / "README.md").read_text(encoding="utf-8")
    by_learning = ("learned.", "clamp_offset.covariance")
    stated = [key for key in KEYS if not key.place.startswith(by_learning)]
    missing = [key.name for key in stated if key.name.split(".")[1] not in text]
    assert missing == []


def test_no_known_key_is_taken_for_a_missing_one(tmp_path: Path) -> None:
    path, missing = tmp_path / "rig.json", 0
    full = replace(rig(), sag=1e-3, sag_in_plane=np.array([0.0, 1e-3]), known_psi=0.1, bits=8)
    full = replace(full, tolerances=replace(full.tolerances, camera_shift_px=0.1))
    full = replace(full, sensors=Sensors(1e-3, 1e-3, 1e-3), light=Light(0.1, distance=0.5))
    document = json.loads(rig_to_json(full))
    for section, keys in document.items():
        for key in keys:
            path.write_text(
                json.dumps(document | {section: {k: v for k, v in keys.items() if k != key}})
            )
            try:
                read_rig(path)
            except InputError as error:
                missing += 1
                assert str(error) == f"{path}: the key {section}.{key} is missing"  # noqa: PT017
    assert missing > 15


def test_the_kind_of_camera_comes_back_and_is_a_pinhole_unless_said(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    for telecentric in (False, True):
        path.write_text(rig_to_json(replace(rig(), telecentric=telecentric)))
        assert read_rig(path).telecentric is telecentric
    document = json.loads(path.read_text())
    del document["camera"]
    path.write_text(json.dumps(document))
    assert read_rig(path).telecentric is False


def test_an_end_that_is_not_stated_to_be_sharp_is_uncertain(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    path.write_text(rig_to_json(rig(tip=3e-5)))
    assert read_rig(path).tolerances.tip == pytest.approx(3e-5)
    document = json.loads(path.read_text())
    del document["beam"]["tip_sigma_mm"]
    path.write_text(json.dumps(document))
    assert read_rig(path).tolerances.tip == pytest.approx(TIP_SIGMA_RADII * rig().beam.radius)


def test_the_lights_slope_comes_back_and_is_uncertain_unless_said(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    lit = replace(rig(), light=Light(-0.7, 0.1, 0.4, 0.6))
    path.write_text(rig_to_json(lit))
    assert read_rig(path).light == lit.light
    path.write_text(rig_to_json(rig()))
    assert "light" not in json.loads(path.read_text())
    assert read_rig(path).light == Light(0.0, ANY_LIGHT, None, ANY_LIGHT)


@pytest.mark.parametrize(
    "board",
    [
        Chessboard(12, 9, 0.018),
        Charuco(12, 10, 0.018, "4x4_100"),
        LineNetwork(12, 10, 0.018, 0.0016),
    ],
    ids=["chessboard", "charuco", "lines"],
)
@pytest.mark.parametrize("coefficients", [0, 5, 8])
def test_board_and_lens_come_back(tmp_path: Path, board: Board, coefficients: int) -> None:
    path = tmp_path / "rig.json"
    told = replace(rig(), board=board, distortion_coefficients=coefficients)
    path.write_text(rig_to_json(told))
    found = read_rig(path)
    assert type(found.board) is type(board)
    assert asdict(found.board) == pytest.approx(asdict(board))
    assert found.distortion_coefficients == coefficients


def test_a_rig_silent_about_board_and_lens_has_a_chessboard_and_no_distortion(
    tmp_path: Path,
) -> None:
    document = json.loads(rig_to_json(rig()))
    del document["board"]["kind"], document["camera"]["distortion_coefficients"]
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(document))
    assert isinstance(read_rig(path).board, Chessboard)
    assert read_rig(path).distortion_coefficients == 0


@pytest.mark.parametrize(
    ("board", "said"),
    [
        ({"kind": "circles"}, "board.kind is 'circles', allowed is one of chessboard, charuco"),
        ({"kind": "charuco"}, "the key board.dictionary is missing"),
        ({"kind": "charuco", "dictionary": "5x5_50"}, "allowed is one of 4x4_50, 4x4_100"),
        ({"kind": "charuco", "dictionary": "4x4_50"}, "has 65 markers, the dictionary 4x4_50 only"),
        ({"kind": "lines"}, "the key board.line_width_mm is missing"),
        (
            {"kind": "lines", "line_width_mm": 3.6},
            "line width is 0.2 of a square, allowed is up to",
        ),
    ],
)
def test_a_board_that_cannot_be_is_named(
    tmp_path: Path, board: dict[str, object], said: str
) -> None:
    document = json.loads(rig_to_json(rig()))
    document["board"] |= board
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_rig(path)
    assert str(path) in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("projection", "coefficients", "said"),
    [("perspective", 4, "allowed is one of 0, 5, 8"), ("telecentric", 5, "has none")],
)
def test_a_lens_that_cannot_be_is_named(
    tmp_path: Path, projection: str, coefficients: int, said: str
) -> None:
    document = json.loads(rig_to_json(rig()))
    lens = {"projection": projection, "distortion_coefficients": coefficients}
    document["camera"] |= lens
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=f"distortion_coefficients is {coefficients}, .*{said}"):
        read_rig(path)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("beam.length_mm", 0, "is 0, allowed is a number from 1e-06 to 1e+06"),
        ("beam.length_mm", "240", "is '240', allowed is a number"),
        ("beam.length_mm", 10**400, "allowed is a number from"),
        ("beam.diameter_mm", 241, "is 241, allowed is a number from 1e-06 to 240"),
        ("beam.flexural_rigidity_n_mm2", float("inf"), "is inf, allowed is a number from"),
        ("light.slope", 11, "is 11, allowed is a number from -10 to 10"),
        ("light.slope_sigma", -1, "is -1, allowed is a number from 0 to 10"),
        ("beam.sag_mm", 1e308, "is 1e+308, allowed is a number from -240 to 240"),
        ("beam.deflects_towards", 0.5, "is 0.5, allowed is one of 1, -1"),
        ("beam.deflects_towards", True, "is True, allowed is one of 1, -1"),
        ("beam.diameter_mm", None, "is None, allowed is a number"),
        ("camera.bits", 7, "is 7, allowed is a whole number from 8 to 16"),
        ("camera.channel", "x" * 10000, "xxx', allowed is one of gray, r, g, b, lab_b"),
        ("base.position_mm", [0, 0], "three numbers"),
        ("base.position_mm", [0, 0, float("nan")], "three numbers"),
        ("encoder.sigma_deg", -1, "from 0 to 180"),
        ("board.columns", True, "from 3 to 200"),
        ("board.rows", 10**12, "from 3 to 200"),
        ("board.columns", 12.5, "whole"),
        (
            "camera.projection",
            "orthographic",
            "'orthographic', allowed is one of perspective, tele",
        ),
        ("camera.projection", None, "None, allowed is one of perspective, telecentric"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, key: str, value: object, allowed: str) -> None:
    document = json.loads(rig_to_json(rig()))
    section, name = key.split(".")
    document.setdefault(section, {})[name] = value
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_rig(path)
    for part in (str(path), key, allowed):
        assert part in str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 300


def test_missing_and_broken_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(tmp_path / "none.json")
    path = tmp_path / "rig.json"
    path.write_text("{")
    with pytest.raises(InputError, match="not JSON"):
        read_rig(path)
    path.write_text("{}")
    with pytest.raises(InputError, match="missing"):
        read_rig(path)


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"beam": ' * 20_000 + "1" + "}" * 20_000,
        " " * 1_000_000,
        "\udcff",
        "1" * 5000,
    ],
    ids=["brackets", "sections", "blanks", "no UTF-8", "digits"],
)
def test_a_file_that_is_no_rig_is_one_sentence(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rig.json"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(InputError) as caught:
        read_rig(path)
    assert len(str(caught.value)) < len(str(path)) + 300


def test_an_encoder_is_optional(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    document = json.loads(rig_to_json(rig()))
    del document["encoder"]
    path.write_text(json.dumps(document))
    assert read_rig(path).tolerances.encoder == pytest.approx(math.radians(ENCODER_SIGMA_DEG))


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "rig.json")
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(tmp_path / "rig.json")


ODD: tuple[Any, ...] = (
    *(None, True, "", "240", [], {}, [1, 2, 3], [[1]], {"x": 1}, [math.nan] * 3, [1e308] * 3),
    *(0, -1, 3, 10**400, -(10**20), 1e308, -1e308, 5e-324, 1e-30, 1e30, math.nan, math.inf),
)


def test_any_rig_is_read_or_refused(tmp_path: Path) -> None:
    """Values that are wrong in every way: what is not refused is finite and of its type."""
    random = Random(scene_seed(0))
    whole = json.loads(
        rig_to_json(
            replace(
                rig(encoder=1e-3),
                known_psi=0.1,
                sag=1e-4,
                sag_in_plane=np.array([0.0, 1e-4]),
                sensors=Sensors(1e-4, 1e-3, 1e-4),
                bits=12,
                channel="r",
                distortion_coefficients=5,
            )
        )
    )
    path = tmp_path / "rig.json"
    refusals, texts = [], []
    for _ in range(500):
        document = deepcopy(whole)
        for _ in range(random.choice((1, 1, 2))):
            section = random.choice(list(document))
            names = list(document[section]) if isinstance(document[section], dict) else []
            if names and random.random() < 0.9:
                name = random.choice(names)
                document[section][name] = random.choice(ODD)
            else:
                document[section] = random.choice(ODD)
        path.write_text(json.dumps(document))
        try:
            texts.append(rig_to_json(read_rig(path)))
        except InputError as error:
            refusals.append(str(error))
    assert all(said.startswith(str(path)) and "\n" not in said for said in refusals)
    assert not any("NaN" in text or "Infinity" in text for text in texts)
    assert len(refusals) > 300
    assert len(texts) > 4  # 25 +- 5


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("beam.lenght_mm", "beam.length_mm"),
        ("beam.known_psi", "beam.known_psi_deg"),
        ("base.position_sigma", "base.position_sigma_mm"),
        ("camera.distorsion_coefficients", "camera.distortion_coefficients"),
        ("length_mm", "beam.length_mm"),
        ("force_sensr.force_sigma_n", "force_sensor"),
    ],
)
def test_a_key_that_means_nothing_is_named_with_the_nearest(
    tmp_path: Path, key: str, nearest: str
) -> None:
    document = json.loads(rig_to_json(rig()))
    *sections, name = key.split(".")
    place = document
    for section in sections:
        place = place.setdefault(section, {})
    place[name] = 1.0
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_rig(path)
    said = str(caught.value)
    assert str(path) in said
    assert said.endswith(f"is unknown, the nearest allowed is {nearest}")
    assert f"the key {key.split('.', maxsplit=1)[0]}" in said


def test_gravity_comes_back_and_is_absent_unless_stated(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    path.write_text(rig_to_json(replace(rig(), gravity=Gravity(-1.5, 2e-3))))
    gravity = read_rig(path).gravity
    assert gravity is not None
    assert (gravity.direction, gravity.sigma) == pytest.approx((-1.5, 2e-3))
    document = json.loads(path.read_text())
    document["gravity"]["direction_deg"] = 361
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"gravity.direction_deg is 361, allowed is a number"):
        read_rig(path)
    path.write_text(rig_to_json(rig()))
    assert read_rig(path).gravity is None
    with pytest.raises(ValueError, match="allowed is finite"):
        Gravity(0.0, -1.0)
