"""Lines without a rig: in a photograph of whiskers, and in drawn images whose truth is known."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from solver.centreline.__main__ import app
from solver.centreline.tracing import Line, trace
from solver.instrument.arrays import Floats, Grey
from tests.beam_images import Look, Sensor, cover, distances

PHOTO = Path(__file__).parents[2] / "data" / "whiskers.png"
SENSOR = Sensor()


@pytest.fixture(scope="module")
def photo() -> Grey:
    return np.asarray(cv2.imread(str(PHOTO), cv2.IMREAD_GRAYSCALE), np.uint8)


@pytest.fixture(scope="module")
def whiskers(photo: Grey) -> list[Line]:
    """From top to bottom."""
    return sorted(trace(photo), key=lambda line: float(line.centreline.points[:, 1].mean()))


def test_three_whiskers_are_followed_over_all_that_is_seen_of_them(whiskers: list[Line]) -> None:
    assert len(whiskers) == 3
    assert {line.polarity for line in whiskers} == {-1}
    for line in whiskers:
        column = line.centreline.points[:, 0]
        # The fur ends at about column 100, the image at 299.
        assert column.min() < 120
        assert column.max() == 299
        assert len(column) > 165
    # One passes in front of the pole, in whose shade it cannot be seen.
    shade = whiskers[0].centreline.rejected[:, 0]
    assert shade.min() > 245
    assert shade.max() < 285
    assert sum(len(line.centreline.rejected) for line in whiskers[1:]) <= 5


def test_every_point_lies_in_the_dark_of_its_whisker(photo: Grey, whiskers: list[Line]) -> None:
    for line in whiskers:
        u, v = np.rint(line.centreline.points).astype(int).T
        beside = [photo[v + off, u].astype(int) for off in (-4, 4)]
        assert (photo[v, u] < np.mean(beside, axis=0)).all()
        lower = photo[v, u] < np.minimum(*beside)
        assert lower.mean() > 0.9
        # Neither on the fur nor in the dark of the pole.
        assert (photo[v, u] > 15).all()


def test_the_whiskers_are_smooth_to_less_than_a_tenth_of_a_pixel(whiskers: list[Line]) -> None:
    for line in whiskers:
        assert line.roughness < 0.1
        assert 0.01 < np.median(line.centreline.sigma) < 0.1


@pytest.mark.parametrize("change", ["turned", "negative", "deep", "mirrored"])
def test_the_changed_photograph_shows_the_same(
    photo: Grey, whiskers: list[Line], change: str
) -> None:
    changed = {
        "turned": np.ascontiguousarray(photo.T),
        "negative": 255 - photo,
        "deep": photo.astype(np.uint16) * 257,
        "mirrored": np.ascontiguousarray(photo[:, ::-1]),
    }[change]
    lines = trace(changed)
    assert len(lines) == 3
    assert lines[0].polarity == (1 if change == "negative" else -1)
    for line in lines:
        points = np.array(line.centreline.points)
        if change == "turned":
            points = points[:, ::-1]
        if change == "mirrored":
            points[:, 0] = photo.shape[1] - 1 - points[:, 0]
        known = min(
            (w.centreline.points for w in whiskers),
            key=lambda w: abs(w[:, 1].mean() - points[:, 1].mean()),
        )
        # Away from the fur, where they are alike.
        inner = points[points[:, 0] > 130]
        place = np.interp(inner[:, 0], known[:, 0], known[:, 1])
        # The noise of a negative is not a sensor's: less of it is trusted beside the pole.
        assert len(inner) > (110 if change == "negative" else 140)
        assert np.median(np.abs(inner[:, 1] - place)) < 0.03


def arcs() -> list[Floats]:
    """Three lines of pixels (n, 2): a level one, one that climbs to the upright, a steep one."""
    t = np.linspace(0, 1, 1500)
    level = np.column_stack([20 + 250 * t, 40 + 12 * np.sin(2 * t)])
    turn = np.column_stack([60 + 110 * np.sin(1.5 * t), 210 - 110 * (1 - np.cos(1.5 * t))])
    steep = np.column_stack([240 + 25 * t**2, 60 + 170 * t])
    return [level, turn, steep]


@pytest.mark.parametrize(("bright", "radius"), [(True, 0.8), (False, 0.8), (True, 2.2)])
def test_drawn_lines_are_followed_to_hundredths_of_a_pixel(bright: bool, radius: float) -> None:
    look = Look(radius_px=radius, roundness=0.0)
    light = np.full((240, 300), 0.05 if bright else 0.7)
    for line in arcs():
        covered, _ = cover(line, look, light.shape, points=377, generator=233)
        light = light * (1 - covered) + (0.8 if bright else 0.1) * covered
    found = trace(SENSOR(light, np.random.default_rng(1)))
    assert len(found) == 3
    for truth in arcs():
        away = [float(np.abs(distances(f.centreline.points, truth)).mean()) for f in found]
        nearest = found[int(np.argmin(away))]
        seen = nearest.centreline
        assert nearest.polarity == (1 if bright else -1)
        off = distances(seen.points, truth)
        assert np.abs(off).max() < 0.2
        assert off.std() < 0.03
        assert off.std() < 1.3 * np.median(seen.sigma)
        ends = np.hypot(*(seen.points[[0, -1], None] - truth[None, [0, -1]]).transpose(2, 0, 1))
        assert ends.min(axis=0).max() < 8


@pytest.mark.parametrize("kind", ["even", "noise", "squares", "blobs", "dots"])
def test_what_is_no_line_is_not_followed(kind: str) -> None:
    random = np.random.default_rng(5)
    v, u = np.mgrid[:200, :300]
    blob = np.exp(-((u - 150) ** 2 + (v - 90) ** 2) / (2 * 25.0**2))
    light = {
        "even": np.full((200, 300), 0.4),
        "noise": random.uniform(0.2, 0.6, (200, 300)),
        "squares": 0.2 + 0.4 * (((u // 25) + (v // 25)) % 2),
        "blobs": 0.6 - 0.5 * blob,
        "dots": 0.6 - 0.4 * (random.uniform(size=(200, 300)) < 0.01),
    }[kind]
    assert trace(SENSOR(light, random)) == []


def test_the_command_writes_points_and_a_picture(tmp_path: Path) -> None:
    out, picture = tmp_path / "points.csv", tmp_path / "lines.png"
    done = CliRunner().invoke(app, [str(PHOTO), "--out", str(out), "--overlay", str(picture)])
    assert done.exit_code == 0, done.output
    rows = list(csv.DictReader(out.read_text(encoding="utf-8").splitlines()))
    assert {row["line"] for row in rows} == {"0", "1", "2"}
    assert all(0 < float(row["sigma_px"]) < 0.5 for row in rows)
    drawn = cv2.imread(str(picture))
    assert drawn is not None
    assert drawn.shape == (1600, 1200, 3)
