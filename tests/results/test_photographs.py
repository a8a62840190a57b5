"""Photographs of a beam with hung weights: what is drawn, stated, rendered and scored."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from results.photographs import draw, folder
from results.photographs.draw import RigDraw, draw_rig
from results.photographs.measure import Solved, compare, record, solve
from results.photographs.page import lines, markdown, picture, records
from results.photographs.picture import Shot, rendered
from results.photographs.skewers import DEVELOPMENT, HELD_OUT, Asked, document, table
from solver.instrument.arrays import Floats
from solver.photographs.photos_json import FILE, read_photos
from vbaa_bench.render.variant import PLAIN, activate

# A rig whose beam is wide enough for a tenth of the image's size: of spruce, on a dark table.
SEED, NUMBER = 7, 1


def small(rig: RigDraw, factor: float, **changes: object) -> RigDraw:
    """A rig whose camera has fewer pixels."""
    camera = rig.photos[3].camera
    reduced = {
        **camera,
        "width_px": round(camera["width_px"] * factor),
        "height_px": round(camera["height_px"] * factor),
        "focal_length_px": camera["focal_length_px"] * factor,
        **changes,
    }
    return rig._replace(photos=[photo._replace(camera=reduced) for photo in rig.photos[2:4]])


def test_a_rig_depends_on_seed_and_number_only() -> None:
    assert draw_rig(SEED, 3) == draw_rig(SEED, 3)
    assert draw_rig(SEED, 3).truth != draw_rig(SEED, 4).truth
    assert draw_rig(SEED, 3).truth != draw_rig(SEED + 1, 3).truth


def test_rigs_are_within_their_limits_and_hide_the_truth() -> None:
    for number in range(40):
        rig = draw_rig(SEED, number)
        assert 8 <= len(rig.photos) <= 10
        assert 2.0 <= rig.truth["width_px"] <= 40.0
        loads = [photo.load for photo in rig.photos if photo.load]
        assert [load.known for load in loads] == [True] + [False] * (len(loads) - 1)
        beam = rig.stated["beam"]
        assert abs(beam["length_mm"] - rig.truth["length_mm"]) < 5 * beam["length_sigma_mm"]
        assert beam["length_mm"] != rig.truth["length_mm"]
        text = json.dumps(rig.stated)
        for key in ("flexural_rigidity_n_mm2", "focal_length_px", "length_mm", "tip_ratio"):
            assert repr(rig.truth[key]) not in text


def test_a_lens_with_distortion_shows_the_beam_where_it_is(variant: str) -> None:
    if variant == PLAIN:
        pytest.skip("slow without LLVM, and the same")
    rig = small(draw_rig(SEED, NUMBER), 0.25, distortion=[-0.15, 0.0, 0.0, 0.0, 0.0])
    # Black on blue: light from one side does not displace its edges.
    even = {**rig.scene["background"], "contrast": 0.01}
    colours = {"beam": (0.0, 0.0, 0.0), "background": (0.2, 0.3, 0.8)}
    rig = rig._replace(scene={**rig.scene, "background": even}, colours=colours)
    shot = Shot(rig, rig.photos[1])
    activate(variant.replace("_mono", "_rgb"), 2)
    jpeg = rendered(shot, 1, passes=2)
    activate(variant, 2)  # other tests are in gray
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    blue, _, red = np.moveaxis(np.asarray(image, dtype=float), 2, 0)
    assert blue.shape == (315, 420)
    assert (blue - red)[5:40].mean() > 20
    offsets = edges_middle(255 - blue, shot)
    assert np.abs(offsets).max() < 0.2
    assert abs(offsets.mean()) < 0.04


def edges_middle(image: Floats, shot: Shot) -> Floats:
    """Offsets [px] of the middle of a bright beam from its true centreline's image."""
    line = shot.centreline_px
    tangents = np.gradient(line, axis=0)
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    load = shot.photo.load
    assert load is not None
    at = load.at_mm / shot.rig.truth["length_mm"]
    share = np.linspace(0, 1, len(line))
    offsets = np.linspace(-8, 8, 161)
    found = []
    # Beside the clamp, its foot and the thread.
    for i in np.flatnonzero((share > 0.3) & (share < 0.95) & (np.abs(share - at) > 0.08)):
        places = (line[i] + offsets[:, None] * normals[i]).astype(np.float32)
        profile = cv2.remap(
            image.astype(np.float32), places[:, 0], places[:, 1], cv2.INTER_LINEAR
        ).ravel()
        level = (profile.max() + np.median(profile)) / 2
        above = np.flatnonzero(profile > level)
        found.append((offsets[above[0]] + offsets[above[-1]]) / 2)
    return np.array(found)


def test_a_folder_states_what_a_laboratory_knows_and_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = draw_rig(SEED, NUMBER)
    rig = rig._replace(photos=rig.photos[:4])
    monkeypatch.setattr(folder, "draw_rig", lambda _seed, _number: rig)
    white = np.full((60, 80, 3), 255, np.uint8)
    jpeg = cv2.imencode(".jpg", white)[1].tobytes()
    calls: list[int] = []

    def render(_shot: Shot, number: int) -> bytes:
        calls.append(number)
        return jpeg

    monkeypatch.setattr(folder, "rendered", render)
    folder.write_rig(SEED, NUMBER, tmp_path)
    photos = tmp_path / "rigs" / "rig_0001"
    document = json.loads((photos / "photos.json").read_text())
    truth = json.loads((tmp_path / "truth" / "rig_0001.json").read_text())
    assert [one["file"] for one in document["photos"]] == [
        "rest_0.jpg", "rest_1.jpg", "load_0.jpg", "load_1.jpg",
    ]  # fmt: skip
    rest, known, unknown = document["photos"][0], document["photos"][2], document["photos"][3]
    assert "load" not in rest
    assert unknown["load"] == {"kind": "weight"}
    assert known["load"]["force_n"] == pytest.approx(truth["photos"][2]["force_n"], rel=0.01)
    assert known["load"]["force_n"] != truth["photos"][2]["force_n"]
    sigma = document["mark_sigma_px"]
    for stated, true in zip(document["photos"], truth["photos"], strict=True):
        clicks = np.array([stated["clamp_px"], stated["tip_px"]])
        off = np.abs(clicks - np.array(true["centreline_px"])[[0, -1]])
        assert 0 < off.max() < 5 * sigma
        assert len(stated["marks"]) == len(rig.marks_mm) >= 2
    # An interrupted rig is finished without its photographs being taken again; a whole one is kept.
    assert calls == [0, 1, 2, 3]
    (photos / "photos.json").unlink()
    folder.write_rig(SEED, NUMBER, tmp_path)
    folder.write_rig(SEED, NUMBER, tmp_path)
    assert calls == [0, 1, 2, 3]
    assert json.loads((photos / "photos.json").read_text()) == document
    # Photographs without a beam: the solver's message is kept, and nothing is answered.
    solve(NUMBER, tmp_path)
    solved = compare(NUMBER, tmp_path)
    assert [one.file for one in solved] == ["load_1.jpg"]
    assert solved[0].force_estimate_n is None
    assert record(solved)["answered_pct"] == 0.0
    page = markdown(records(solved), solved, "command", "photographs.jpg")
    assert "command" in page
    monkeypatch.setattr("results.photographs.page.rig_name", lambda _: "rig_0001")
    assert picture(tmp_path, 2).startswith(b"\xff\xd8")


def test_errors_are_those_of_unknown_loads_in_percent() -> None:
    one = Solved(0, "a.jpg", "contact", 400.0, 8.0, True, 2.0, 200.0, 2.02, 0.01, 204.0, 1.0)
    other = one._replace(
        force_estimate_n=1.9, force_sigma_n=0.04, s_c_estimate_mm=198.0, s_c_sigma_mm=2.0
    )
    missing = one._replace(rig=1, outcome="weak contact", force_estimate_n=None,
                           force_sigma_n=None, s_c_estimate_mm=None, s_c_sigma_mm=None)  # fmt: skip
    scored = record([one, other, missing])
    assert scored["rigs"] == 2
    assert scored["answered_pct"] == pytest.approx(200 / 3)
    assert scored["force_rmse_pct"] == pytest.approx(np.sqrt((1 + 25) / 2))
    assert scored["force_in_3_sigma_pct"] == 100.0
    assert scored["place_median_pct"] == pytest.approx(0.75)
    assert scored["place_in_3_sigma_pct"] == 50.0
    assert scored["place_sigma_over_rmse"] == pytest.approx(0.375 / np.sqrt((1 + 0.25) / 2))
    assert len(lines(records([one, other]))) == 4
    assert draw.WIDTH_PX * draw.HEIGHT_PX >= 2e6


def replace_estimate(
    one: Solved, force: float, force_sigma: float, s: float, sigma: float
) -> Solved:
    return one._replace(
        force_estimate_n=force, force_sigma_n=force_sigma, s_c_estimate_mm=s, s_c_sigma_mm=sigma
    )


def test_the_marks_of_real_photographs_state_one_force(tmp_path: Path) -> None:
    skewers = DEVELOPMENT | HELD_OUT
    for places in (True, False):
        stated = document(skewers, "9V_7in", places=places)
        (tmp_path / FILE).write_text(json.dumps(stated), encoding="utf-8")
        photos = read_photos(tmp_path).photographs
        assert len(photos) == 6
        loads = [photo.load for photo in photos if photo.load]
        assert [load.force is not None for load in loads].count(True) == 1
        assert [load.place is not None for load in loads].count(True) == (6 if places else 1)
        assert all(len(photo.ticks) >= 2 for photo in photos)
    unanswered = Asked(6, "9V_7in", "asked", "D_7in", 1.354, None, None, "not identifiable")
    assert "| D_7in | 1.35 |  |  | not identifiable |" in table([unanswered])
