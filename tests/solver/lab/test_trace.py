"""The command `trace`: images in, a table of points out."""

import csv
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

import solver
from solver.__main__ import main
from solver.instrument.arrays import Floats
from solver.instrument.errors import IncompleteError, InputError
from solver.instrument.images import read_grey
from solver.lab import trace_command
from solver.lab.shots import Shot, Source
from solver.lab.trace_command import COLUMNS
from tests.command_line import CommandLine
from tests.command_words import calls
from tests.draws import generator
from tests.photographed import Look, Photograph, centreline, photograph_of

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "solver" / "example"
SHAPE = (300, 480)


def photographed(bend: float, look: Look, seed: int) -> Photograph:
    random = generator(__name__, seed)
    line = centreline(np.array([60.0, 150.0]), 0.05, 360.0, bend, 0.8)
    return photograph_of(line, 8.0, SHAPE, look, random)


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def mark(point: Floats) -> str:
    return f"{point[0]:.1f},{point[1]:.1f}"


def test_the_examples_of_the_page_run_and_agree_with_the_rig(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (ROOT / "docs" / "beam_and_phone.md").read_text(encoding="utf-8")
    scripts = re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
    tracings = [call.words for script in scripts for call in calls(script)]
    (tmp_path / "solver").mkdir()
    (tmp_path / "solver" / "example").symlink_to(EXAMPLE)
    monkeypatch.chdir(tmp_path)
    command, ran = CommandLine(main, capfd), 0
    for words in tracings:
        if words[0] == "trace":
            assert command(*words).status == 0
            ran += 1
    assert ran == 2
    rows = table(tmp_path / "points.csv")
    assert tuple(rows[0]) == COLUMNS
    points = np.array(
        [[float(row[name]) for name in COLUMNS[2:8]] for row in rows if row["width_px"]]
    )
    image = read_grey(EXAMPLE / "images" / "push_3_2.png")
    # The rig's extractor knows the beam's appearance and the lens.
    line = solver.open_rig(EXAMPLE).tracker().solve(image).line
    assert line is not None
    dense = np.array(
        [np.interp(np.arange(60, 450, 0.2), *line.points[:, [0, axis]].T) for axis in (0, 1)]
    )
    inner = points[(points[:, 0] > 65) & (points[:, 0] < 445)]
    off = (inner[:, :2] - dense.T[cKDTree(dense.T).query(inner[:, :2])[1]]) @ [0.0, 1.0]
    assert np.sqrt(np.mean(off**2)) < 0.15
    film = table(tmp_path / "film.csv")
    assert {row["image"] for row in film} == {str(i) for i in range(9)}
    assert {row["part"] for row in film} <= {"measured", "faint", "hidden", "outlier"}
    assert len(list((tmp_path / "film").glob("*.png"))) == 9


def test_images_of_a_moving_beam_are_followed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    photos = [photographed(bend, Look(), i) for i, bend in enumerate((0.0, 0.05, 0.1, 0.3))]
    paths = [tmp_path / f"{i}.png" for i in range(len(photos))]
    for path, photo in zip(paths, photos, strict=True):
        cv2.imwrite(str(path), np.rint(photo.image).astype(np.uint8))
    first, out = photos[0].line, tmp_path / "points.csv"
    marks = ("--start", mark(first[0]), "--end", mark(first[-1]))
    ended = CommandLine(main, capfd)("trace", *paths, *marks, "--out", out)
    assert ended.status == 0, ended
    assert ended.out.count("% measured") == 4
    rows = table(out)
    for path, photo in zip(paths, photos, strict=True):
        own = [row for row in rows if row["image"] == str(path) and row["part"] == "measured"]
        points, normals = (
            np.array([[float(row[name]) for name in names] for row in own])
            for names in (("u_px", "v_px"), ("normal_u", "normal_v"))
        )
        assert np.sqrt(np.mean(photo.off(points, normals) ** 2)) < 0.1
        assert (np.diff(points[:, 0]) > 0).all()


def test_parts_that_are_covered_are_named() -> None:
    photo = photographed(0.2, Look(), 5)
    image = photo.image.copy()
    image[120:210, 230:270] = 190.0  # a sheet of the beam's brightness
    beam = solver.trace(image, tuple(photo.line[0]), tuple(photo.line[-1]))
    covered = (beam.rejected[:, 0] > 230) & (beam.rejected[:, 0] < 270)
    assert np.count_nonzero(covered) >= 4
    assert set(beam.reasons) <= {"hidden", "faint", "outlier"}
    between = (beam.points[:, 0] > 236) & (beam.points[:, 0] < 264)
    assert not between.any()
    assert (
        np.abs(photo.off(beam.rejected[covered], np.tile([0.0, 1.0], (covered.sum(), 1)))).max() < 2
    )


def test_an_image_without_the_beam_has_a_row_that_says_why(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    photo = photographed(0.1, Look(), 6)
    empty = np.full(SHAPE, 90, np.uint8)
    for name, image in (("a.png", np.rint(photo.image)), ("b.png", empty)):
        cv2.imwrite(str(tmp_path / name), image.astype(np.uint8))
    words = ("--start", mark(photo.line[0]), "--end", mark(photo.line[-1]))
    out = ("--out", tmp_path / "points.csv")
    command = CommandLine(main, capfd)
    ended = command("trace", tmp_path / "a.png", tmp_path / "b.png", *words, *out)
    assert ended.status == 0
    *_, last = table(tmp_path / "points.csv")
    assert (last["part"], last["u_px"]) == ("no_beam", "")
    assert "no beam is found between start" in last["message"]
    # Nothing is written where there is no beam at all.
    (tmp_path / "points.csv").unlink()
    assert "no beam is found" in command.refused("trace", tmp_path / "b.png", *words, *out)
    assert not (tmp_path / "points.csv").exists()


@pytest.mark.parametrize(
    ("ended_by", "status"),
    [(KeyboardInterrupt(), 130), (IncompleteError("film.avi: ends after 2 of 4 frames"), 1)],
)
def test_what_has_been_traced_is_kept_when_the_images_end_too_early(
    ended_by: BaseException,
    status: int,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    photo = photographed(0.1, Look(), 7)
    paths, out = [tmp_path / f"{name}.png" for name in "abcd"], tmp_path / "points.csv"
    for path in paths:
        cv2.imwrite(str(path), np.rint(photo.image).astype(np.uint8))
    shown = trace_command._with_progress

    def two(source: Source) -> Iterator[Shot]:
        yield from itertools.islice(shown(source), 2)
        raise ended_by

    monkeypatch.setattr(trace_command, "_with_progress", two)
    words = ("--start", mark(photo.line[0]), "--end", mark(photo.line[-1]), "--out", out)
    ended = CommandLine(main, capfd)("trace", *paths, *words)
    assert ended.status == status
    assert f"written to {out}" in ended.out
    assert {row["image"] for row in table(out)} == set(map(str, paths[:2]))


def test_the_overlay_does_not_replace_the_table(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    image, both = EXAMPLE / "images" / "push_1_1.png", tmp_path / "seen.png"
    words = ("--start", "30,90", "--end", "400,90", "--out", both, "--overlay", both)
    refused = CommandLine(main, capfd).refused("trace", image, *words)
    assert f"--out and --overlay are both {both}, allowed are two files" in refused
    assert not both.exists()


def test_a_file_that_is_no_image_is_named_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "text.png"
    path.write_text("no image")
    words = ("--start", "30,90", "--end", "400,90", "--out", tmp_path / "points.csv")
    assert CommandLine(main, capfd).refused("trace", path, *words).count("text.png") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--start", "3", "--end", "9,9"),
            "--start is '3', allowed is a pixel U,V such as 120,85.5",
        ),
        (("--start", "3,nan", "--end", "9,9"), "--start is '3,nan', allowed is a pixel U,V"),
        (("--start", "3,3", "--end", "9,9"), "are 8 px apart, allowed are at least"),
        (
            ("--start", "3,3", "--end", "999,9"),
            "end is [999.0, 9.0], allowed is a place in the image",
        ),
        (
            ("--start", "3,3", "--end", "90,9", "--channel", "x"),
            "--channel is 'x', allowed is one of",
        ),
    ],
)
def test_a_mistake_gets_one_sentence(
    words: tuple[str, ...], message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    image, out = EXAMPLE / "images" / "push_1_1.png", tmp_path / "points.csv"
    assert message in CommandLine(main, capfd).refused("trace", image, *words, "--out", out)
    assert not out.exists()


def test_an_array_that_is_no_image_is_refused() -> None:
    with pytest.raises(InputError, match=r"the image has shape \(4, 4, 2\), allowed are"):
        solver.trace(np.zeros((4, 4, 2)), (0, 0), (3, 3))
