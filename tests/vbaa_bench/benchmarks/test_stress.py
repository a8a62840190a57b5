"""Perturbations change what they say and nothing else; figures are right on synthetic results."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from solver.instrument.arrays import Floats, Grey
from solver.instrument.beam import Beam
from solver.instrument.board import Charuco, Chessboard
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from solver.instrument.rig import Rig, Tolerances
from solver.instrument.rig_json import rig_to_json
from solver.instrument.transforms import apply, camera_looking_at, invert, rigid
from tests.draws import generator
from vbaa_bench import cli
from vbaa_bench.benchmarks.stress import command, geometry, gray, rig_results, stated, video
from vbaa_bench.benchmarks.stress.figures import Figure, figures, missed
from vbaa_bench.benchmarks.stress.recording import (
    NotApplicableError,
    Perturbation,
    Recording,
    read_recording,
    write_recording,
)
from vbaa_bench.benchmarks.stress.rig_results import (
    FrameResult,
    RigResult,
    SolverResult,
    score_frame,
    stress_rig,
)
from vbaa_bench.benchmarks.stress.rigs import drawn_rig
from vbaa_bench.benchmarks.stress.rows import NAMES, ROWS, Row, Targets
from vbaa_bench.benchmarks.stress.table import lines
from vbaa_bench.render import variant
from vbaa_bench.scene.load import load_scene

LENGTH = 0.24
CAMERA = Camera(
    240, 120, 330.0, 330.0, 119.5, 59.5,
    camera_looking_at(np.array([0.12, 0.01, 0.36]), np.array([0.1203, 0.01, 0.0]), 0.02),
)  # fmt: skip
RIG = Rig(
    Beam(LENGTH, 0.8e-3, 4e-3),
    np.array([0.0, 0.001, 0.0]),
    Chessboard(12, 5, 0.015),
    rigid(np.array([0.0, 0.0, 0.01]), np.array([0.11, 0.012, 0.0])),
    1,
    Tolerances(1e-4, 4e-5, 1e-5, 1e-5, 2e-4, 2e-4),
)


def drawn_line(y: float = 0.0, bend: float = 0.0) -> Floats:
    """A bright line along the beam on a textured ground, as gray values (height, width)."""
    v, u = np.mgrid[:120, :240].astype(float)
    s = np.linspace(0.0, 1.0, 400)
    on_c = [s * LENGTH, RIG.base_position[1] + bend * (3 * s**2 - s**3) / 2, np.zeros(400)]
    pixels = CAMERA.project(np.column_stack(on_c))
    off = v - np.interp(u, pixels[:, 0], pixels[:, 1]) - y
    texture = 4 * np.sin(0.11 * u + 0.3) * np.cos(0.07 * v)
    return np.asarray(50 + texture + 120 * np.exp(-(off**2) / 4.5))


def recorded(random: np.random.Generator | None = None) -> Recording:
    random = random or generator(__name__, 0)

    def taken() -> Grey:
        noise = 1.5 * random.standard_normal((120, 240))
        return np.asarray(np.clip(np.rint(drawn_line() + noise), 0, 255).astype(np.uint8))

    boards, rests, frames = ([taken() for _ in range(n)] for n in (2, 3, 4))
    return Recording(RIG, tuple(boards), tuple(rests), tuple(frames), CAMERA)


def run(perturb: Perturbation, recording: Recording | None = None) -> Recording:
    return perturb(recording or recorded(), generator(__name__, 5))


def rows_of_line(image: Grey, dark: float = 90.0) -> Floats:
    """The row of the bright line in each column (width,)."""
    weight = np.clip(np.asarray(image, float) - dark, 0, None)
    return np.asarray((weight * np.arange(len(image))[:, None]).sum(0) / weight.sum(0))


# What each row changes: boards, rests, frames, rig; and with it the images' size or type.
CHANGES = {
    "clean": "",
    "copied_rest": "rests",
    "one_rest": "rests",
    "h264_18": "rests frames",
    "h264_23": "rests frames",
    "h264_18_png_rest": "frames",
    "mjpg": "rests frames",
    "phone": "rests frames",
    "gamma_frames": "frames",
    "flicker": "rests frames",
    "across_0.5": "frames",
    "across_2": "frames",
    "along_0.5": "frames",
    "zoom": "rests frames",
    "square": "rig",
    "board_turned": "rig",
    "length": "rig",
    "rests_bent": "rests",
    "rest_touched": "rests",
    "stabilised": "rests frames",
    "points_left": "rig",
    "rotated_90": "boards rests frames size",
    "rotated_180": "boards rests frames",
    "mirrored": "boards rests frames rig",
    "cropped": "boards rests frames size",
    "smaller": "boards rests frames size",
    "larger": "boards rests frames size",
    "left_aligned": "boards rests frames type",
}


@pytest.mark.thorough
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_perturbation_changes_what_it_says_and_is_repeatable(row: Row) -> None:
    if row.name.startswith("h264"):
        pytest.importorskip("av")
    before = recorded()
    after, again = run(row.perturb, before), run(row.perturb, before)
    expected = CHANGES.get(row.name, "boards rests frames").split()
    for name in ("boards", "rests", "frames"):
        old, new, same = (getattr(one, name) for one in (before, after, again))
        assert list(map(key, new)) == list(map(key, same))
        assert (list(map(key, new)) != list(map(key, old))) == (name in expected), name
        assert name == "rests" or len(new) == len(old)
        assert {image.shape == old[0].shape for image in new} == {"size" not in expected}
        assert {image.dtype == np.uint8 for image in new} == {"type" not in expected}
    assert (rig_to_json(after.rig) != rig_to_json(before.rig)) == ("rig" in expected)
    assert list(map(key, before.frames)) == list(map(key, recorded().frames))


def key(image: Grey) -> tuple[tuple[int, ...], bytes]:
    return image.shape, image.tobytes()


def test_a_shift_moves_the_beam_and_keeps_the_noise() -> None:
    before = recorded()
    u, v = geometry._along(before)
    for pixels, across in ((0.5, (-v, u)), (2.0, (-v, u))):
        after = run(geometry.shifted_across(pixels), before)
        moved = rows_of_line(after.frames[0]) - rows_of_line(before.frames[0])
        assert np.median(moved[30:-30]) == pytest.approx(pixels * across[1], abs=0.02)
    noise = np.asarray(before.frames[0], float) - drawn_line()
    shifted = geometry.shifted(before.frames[0], np.array([0.5, 0.5]))
    clean = geometry.shifted(np.asarray(np.rint(drawn_line()), np.uint8), np.array([0.5, 0.5]))
    left = np.asarray(shifted, float) - np.asarray(clean, float)
    # Rounding adds 1/12 twice to the variance of what was 1.5^2 + 1/12.
    assert left.std() == pytest.approx(noise.std(), rel=0.08)


@pytest.mark.false_alarm(1e-5, "seven uniform shifts: all within a quarter of the largest")
def test_stabilisation_shifts_every_image_by_itself() -> None:
    before = recorded()
    after = run(geometry.stabilised(1.5), before)
    shifts = [
        float(np.median((rows_of_line(new) - rows_of_line(old))[30:-30]))
        for old, new in zip(before.rests + before.frames, after.rests + after.frames, strict=True)
    ]
    assert len(shifts) == 7
    assert np.std(shifts) > 0.1
    assert 0.25 < max(map(abs, shifts)) < 1.6


def test_bent_rest_images_show_the_bend_of_a_force_at_the_tip() -> None:
    before = recorded()
    after = run(geometry.bent_rests(0.5), before)
    touched = run(geometry.bent_rests(0.5, touched=1), before)
    expected = rows_of_line(np.asarray(np.rint(drawn_line(bend=0.5e-3)), np.uint8))
    for image in (*after.rests, touched.rests[1]):
        assert np.abs(rows_of_line(image) - expected)[20:-20].max() < 0.15  # its noise: 0.04
    assert np.array_equal(touched.rests[0], before.rests[0])
    bend = rows_of_line(before.rests[0]) - rows_of_line(after.rests[0])
    assert bend[205:226].mean() == pytest.approx(0.9 * 0.5e-3 * 330 / 0.36, rel=0.2)
    assert abs(bend[10:60]).max() < 0.1


def test_zoom_is_about_the_middle() -> None:
    image = np.zeros((41, 61), np.uint8)
    image[10, 10] = image[20, 30] = 200
    before = replace(recorded(), boards=(image,), rests=(image,), frames=(image,))
    after = run(geometry.zoomed(1.1), before).frames[0]
    assert divmod(int(after[:15, :15].argmax()), 15) == (9, 8)
    assert after[20, 30] == 200


@pytest.mark.parametrize("case", ["mirrored", "mirrored, odd", "rotated_90", "rotated_180"])
def test_a_turned_or_mirrored_rig_describes_the_turned_or_mirrored_images(case: str) -> None:
    """The perturbed rig, seen by some rigid camera, shows points where the changed images do."""
    board = Chessboard(5, 12, 0.015) if case.endswith("odd") else RIG.board
    before = replace(recorded(), rig=replace(RIG, board=board))
    if case.startswith("mirrored"):
        after = run(geometry.mirrored, before)
        flip = np.diag([1.0, -1.0])
    else:
        quarters = 1 if case == "rotated_90" else 2
        after = run(geometry.turned(quarters), before)
        flip = np.eye(2)

    def move(at: Floats) -> Floats:
        u, v = at.T
        there = {
            "mirrored": (239 - u, v),
            "mirrored, odd": (u, 119 - v),
            "rotated_90": (119 - v, u),
            "rotated_180": (239 - u, 119 - v),
        }
        return np.column_stack(there[case])

    # Beam and board as stated before, in the changed image; and as stated after.
    beam = np.array([[0.0, 0.0], [0.24, 0.0], [0.2, 0.03]])
    old, new = before.rig, after.rig
    in_image = move(CAMERA.project(np.column_stack([beam, np.zeros(3)])))
    corners = move(CAMERA.project(apply(old.antenna_from_board, old.board.corners())))
    # A mirrored board is upright in the image: its first corner at the upper left.
    grid = corners.reshape(old.board.rows, old.board.columns, 2)
    if case == "mirrored":
        grid = grid[:, ::-1]
    elif case == "mirrored, odd":
        grid = grid[::-1]
    assert grid.shape[:2] == (new.board.rows, new.board.columns)
    if case.startswith("mirrored"):
        assert grid[0, 0, 0] < grid[0, -1, 0]
        assert grid[0, 0, 1] < grid[-1, 0, 1]
    plane = apply(new.antenna_from_board, new.board.corners())[:, :2]
    homography, _ = cv2.findHomography(plane, grid.reshape(-1, 2))
    stated = cv2.perspectiveTransform((beam @ flip)[:, None], homography)[:, 0]
    assert np.abs(stated - in_image).max() < 1e-3
    assert new.deflects_towards == (-1 if case.startswith("mirrored") else 1)
    assert np.linalg.det(new.antenna_from_board[:3, :3]) == pytest.approx(1.0)


def test_the_reversed_beam_exchanges_clamp_and_tip() -> None:
    after = run(geometry.reversed_beam)
    truly = np.array([[0.0, 0.001, 0.0], [LENGTH, 0.001, 0.0]])
    # What the new rig calls its clamp and tip, in the true antenna's frame.
    true_from_stated = RIG.antenna_from_board @ invert(after.rig.antenna_from_board)
    assert np.allclose(apply(true_from_stated, truly), truly[::-1], atol=1e-12)


def test_a_wrong_rig_is_wrong_by_what_was_asked() -> None:
    assert run(stated.square_wrong(0.01)).rig.board.square == pytest.approx(0.01515)
    assert run(stated.length_wrong(0.02)).rig.beam.length == pytest.approx(0.2448)
    pose = run(stated.board_turned(1.0)).rig.antenna_from_board
    turn = RIG.antenna_from_board[:3, :3].T @ pose[:3, :3]
    assert np.degrees(np.arctan2(turn[1, 0], turn[0, 0])) == pytest.approx(1.0)
    assert np.array_equal(pose[:3, 3], RIG.antenna_from_board[:3, 3])


@pytest.mark.false_alarm(1e-5, "uniform gains: four within 0.15 %, or no two 0.05 % apart")
def test_tone_and_gain() -> None:
    before = recorded()
    assert gray.curved(1 / 2.2)(np.array([[0, 64, 255]], np.uint8)).tolist() == [[0, 136, 255]]
    gains = [
        float(new.mean() / old.mean())
        for old, new in zip(before.frames, run(gray.flickering(0.03)).frames, strict=True)
    ]
    assert len(gains) == 4
    assert np.ptp(gains) > 0.0005
    assert 0.0015 < max(abs(gain - 1) for gain in gains) < 0.031
    grey = run(gray.coloured).frames[0]
    assert np.asarray(grey, float).mean() == pytest.approx(before.frames[0].mean(), abs=0.5)


def test_copies_in_an_mp4_lose_their_noise_and_sizes_are_kept() -> None:
    pytest.importorskip("av")
    odd = tuple(image[:-1, :-1] for image in recorded().frames)
    film = run(video.h264(18, True), replace(recorded(), frames=odd, rests=odd[:3]))
    for old, new in zip(odd, film.frames, strict=True):
        assert new.shape == old.shape
        difference = np.asarray(new, float) - old
        assert abs(difference.mean()) < 0.5
        assert 0.5 < difference.std() < 8


def test_without_pyav_a_row_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(NotApplicableError, match="needs the extra 'video'"):
        run(video.h264(18, False))
    line = lines([{"row": "x", "done": "y", "wanted": {}, "skipped": "needs the extra 'video'"}])
    assert line[0][-1] == "skipped: needs the extra 'video'"


def test_markers_are_not_mirrored() -> None:
    rig = replace(RIG, board=Charuco(12, 5, 0.015, "4x4_250"))
    with pytest.raises(NotApplicableError, match="chessboard"):
        run(geometry.mirrored, replace(recorded(), rig=rig))


def result(
    error: float | None, sigma: float | None, row: Row = ROWS[0], **more: str
) -> FrameResult:
    """The verdict on an answer that is off by `error` % of L, of `sigma`."""
    answer = SolverResult(
        more.get("outcome", "contact" if error is not None else "invalid"),
        points=int(more.get("points", "400")),
        x_c=None if error is None else 0.1 + error / 100 * LENGTH,
        sigma=None if sigma is None else sigma / 100 * LENGTH,
    )
    findings = tuple(more.get("findings", "").split())
    return score_frame("f", answer, 0.1, LENGTH, row, findings)


KNOCKED = next(row for row in ROWS if row.name == "across_2")


@pytest.mark.parametrize(
    ("frame", "verdict"),  # consistent, detected, false
    [
        (result(0.29, 0.1), (True, False, False)),
        (result(-0.31, 0.1), (False, False, True)),
        (result(0.1, None), (False, False, True)),
        (result(None, None), (False, False, False)),
        (result(None, None, points="7"), (True, False, False)),
        (result(None, None, points="7", outcome="no contact"), (False, False, True)),
        (result(None, None, outcome="refused", points="0"), (False, True, False)),
        (result(0.1, 0.1, findings="camera_shift_unknown"), (True, False, False)),
        (result(0.1, 0.1, findings="scale_inconsistent"), (True, True, False)),
        (result(0.1, 0.1, KNOCKED, findings="scale_inconsistent"), (True, False, False)),
        (result(9.0, 0.1, KNOCKED, findings="camera_moved"), (False, True, True)),
        (result(None, None, KNOCKED, outcome="camera moved"), (True, True, False)),
        (result(None, None, KNOCKED, outcome="refused"), (True, True, False)),
        (result(None, None, KNOCKED, outcome="crashed"), (False, False, False)),
    ],
)
def test_verdicts(frame: FrameResult, verdict: tuple[bool, bool, bool]) -> None:
    assert (frame.consistent, frame.detected, frame.false) == verdict


def test_figures_and_their_intervals() -> None:
    good = RigResult(0, frames=(result(0.3, 0.2), result(-0.4, 0.2)))
    bad = RigResult(1, frames=(result(None, None), result(None, None)))
    found = figures([good, bad], seed=1)
    rms = np.sqrt((0.3**2 + 0.4**2) / 2)
    expected = {"answered": 50, "consistent": 50, "detected": 0, "false": 0, "median": 0.35}
    expected |= {"rmse": rms, "sigma_ratio": 0.2 / rms}
    assert {name: one.value for name, one in found.items()} == pytest.approx(expected)
    # Of two rigs a resample has none, one or two that answer.
    assert (found["answered"].low, found["answered"].high) == (0, 100)
    assert found["rmse"].low == pytest.approx(rms) == found["rmse"].high
    assert figures([good, bad], seed=1) == found
    assert figures([bad], seed=1)["rmse"] == Figure(None, None, None)
    assert figures([good], seed=1)["answered"] == Figure(100, None, None)


def test_the_interval_is_that_of_rigs_not_of_frames() -> None:
    """Over rigs that answer all or nothing, a share's standard error is sqrt(p (1 - p) / rigs)."""
    rigs = [
        RigResult(i, frames=(result(0.1 if i < 20 else None, 0.1 if i < 20 else None),) * 10)
        for i in range(40)
    ]
    found = figures(rigs, seed=2)["answered"]
    assert found.low is not None
    assert found.high is not None
    half = 1.96 * 100 * np.sqrt(0.25 / 40)
    assert (found.high - found.low) / 2 == pytest.approx(half, rel=0.15)


def test_wanted_figures_are_held_against_values() -> None:
    wanted = Targets(answered=90, rmse=0.3, consistent=95, sigma_ratio=2, alarmed=5)
    values = {
        "answered": 90.0,
        "rmse": 0.31,
        "consistent": 94.0,
        "sigma_ratio": 2.0,
        "detected": 4.0,
    }
    found = {name: Figure(value, None, None) for name, value in values.items()}
    assert missed(found, wanted) == ("rmse", "consistent")
    assert missed(found | {"rmse": Figure(None, None, None)}, wanted) == ("rmse", "consistent")
    assert missed(found, Targets(alarmed=3, detected=5)) == ("detected", "alarmed")


def test_a_drawn_rig_is_another_one_each_time(small_scene: Path) -> None:
    file = load_scene(small_scene)
    one, same, other, seeded = (
        drawn_rig(file, *which, 10).scene for which in ((1, 0), (1, 0), (1, 1), (2, 0))
    )
    assert one == same
    for another in (other, seeded):
        assert another.seed != one.seed
        assert another.camera.position_mm != one.camera.position_mm
    assert one.tolerances.true_rig == "drawn"
    assert one.sampling is not None
    assert one.sampling.count == 10
    ranges = (one.sampling.contact_distance_mm, one.sampling.deflection_pct)
    assert ranges == ((100.0, 200.0), (10.0, 20.0))


def test_scenes_without_pushes_to_draw_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    free = "pushes: {contact_distance_mm: [100], pushing_angle_deg: [5]}"
    deep = "sensor: {bits: 12}\npushes: {contact_distance_mm: [100], deflection_pct: [10]}"
    for text, said in (
        (free, "has no contact_distance_mm or no deflection_pct"),
        (deep, "bits is 12, allowed is 8"),
    ):
        path.write_text(f"title: No\nseed: 1\n{text}\n", encoding="utf-8")
        with pytest.raises(InputError, match=said):
            drawn_rig(load_scene(path), 1, 0, 10)


def test_a_perturbed_tree_keeps_names_readings_and_order(dataset: Path, tmp_path: Path) -> None:
    observations, target = dataset / "observations", tmp_path / "perturbed"
    write_recording(
        run(gray.one_rest_image, read_recording(observations, CAMERA)), observations, target
    )
    old, new = open_observations(observations), open_observations(target)
    assert [(f.frame_id, f.readings) for f in new] == [(f.frame_id, f.readings) for f in old]
    assert all(np.array_equal(a.image(), b.image()) for a, b in zip(old, new, strict=True))
    assert (len(old.rest_images), len(new.rest_images)) == (2, 1)
    assert len(old.board_views) == len(new.board_views)


@pytest.mark.thorough
def test_one_rig_from_end_to_end(dataset: Path) -> None:
    rows = {row.name: row for row in ROWS}
    clean, mirrored = (
        stress_rig(dataset, 0, rows[name], "exact_fit", 1) for name in ("clean", "mirrored")
    )
    assert [frame.outcome for frame in clean.frames] == ["contact"] * 4
    for frame, other in zip(clean.frames, mirrored.frames, strict=True):
        assert frame.consistent
        assert abs(frame.error_pct or 9) < 0.3
        assert other.error_pct == pytest.approx(frame.error_pct, abs=0.03)


def test_a_refused_rig_is_told_in_every_frame(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_observations: object) -> None:
        raise InputError("no board")

    monkeypatch.setattr(rig_results, "set_up", refuse)
    told = stress_rig(dataset, 0, ROWS[0], "exact_fit", 1)
    assert told.refusal == "no board"
    assert {(f.outcome, f.message) for f in told.frames} == {("refused", "no board")}


def test_the_command_prints_and_writes_the_table(
    small_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = RigResult(0, frames=(result(0.05, 0.05), result(None, None)))

    def measured(_roots: object, rows: list[Row], *_rest: object) -> list[dict[str, object]]:
        return [command._record(row, [rig], 1) for row in rows]

    monkeypatch.setattr(variant, "choose", str)  # probing the renderer takes seconds
    monkeypatch.setattr(command, "render", lambda *_given: [])
    monkeypatch.setattr(command, "measure", measured)
    out = tmp_path / "table.json"
    arguments = ["stress", str(small_scene), "--row", "clean", "--row", "along_0.5"]
    done = CliRunner().invoke(cli.app, [*arguments, "--out", str(out)], env={"COLUMNS": "40"})
    assert done.exit_code == 1, done.output
    for said in ("clean", "along_0.5", "no: answered, consistent", "0.05", "no: detected"):
        assert said in done.stdout
    written = json.loads(out.read_text(encoding="utf-8"))
    assert len(written["rows"][0]["rigs"][0]["frames"]) == 2
    scripted = CliRunner().invoke(cli.app, [*arguments, "--json"])
    assert json.loads(scripted.stdout)["rows"][0]["figures"]["answered"]["value"] == 50


def test_unknown_rows_and_methods_are_refused(small_scene: Path, tmp_path: Path) -> None:
    file = load_scene(small_scene)
    for rows, method, said in (
        (["frog"], "exact_fit", "row 'frog'"),
        ([], "frog", "method 'frog'"),
    ):
        plan = command.Plan(file, 1, 1, 1, rows, method)
        with pytest.raises(InputError, match=said):
            command.stress(plan, tmp_path, "none", 1, lambda *_at: None)


def test_every_row_has_a_name_of_its_own_and_wants_something() -> None:
    assert len(set(NAMES)) == len(ROWS)
    assert all(row.wanted.record() for row in ROWS)
