"""`python -m solver` beside a real camera: images, videos, streams, overlays, EI, the board."""

import csv
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.__main__ import main
from solver.antenna import Antenna
from solver.at_rest.agreement import Learn
from solver.centreline.extractor import learn_profile_fit
from solver.centreline.extractors import EXTRACTORS
from solver.instrument.arrays import Grey
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import png_bytes, read_grey
from solver.instrument.observation import Observations, open_observations
from solver.instrument.rig import Rig
from solver.lab.findings import findings
from solver.learning.hung_rigidity import hung_beam
from solver.learning.learn import LearnedBeam
from solver.set_up import set_up
from tests.command_line import CommandLine
from tests.consistency import MOST_SIGMAS
from tests.draws import generator


class CalibratesOnce:
    """In place of `set_up`: what has been calibrated in the same way before is used again."""

    def __init__(self, observations: Observations, antenna: Antenna) -> None:
        self._antennas = {self._key(observations, learn_profile_fit): antenna}

    def __call__(self, opened: Observations, learn: Learn = learn_profile_fit) -> Antenna:
        key = self._key(opened, learn)
        if key not in self._antennas:
            self._antennas[key] = set_up(opened, learn)
        return self._antennas[key]

    @staticmethod
    def _key(opened: Observations, learn: Learn) -> tuple[object, ...]:
        return opened.root, opened.rig.channel, bool(opened.frames), learn


@pytest.fixture(scope="module")
def calibrates_once(observations: Observations, antenna: Antenna) -> CalibratesOnce:
    return CalibratesOnce(observations, antenna)


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    calibrates_once: CalibratesOnce,
) -> CommandLine:
    """The real command line, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("solver.lab.command_line.set_up", calibrates_once)
    return CommandLine(main, capfd)


@pytest.fixture(scope="module")
def root(dataset: Path) -> Path:
    return dataset / "observations"


@pytest.fixture(scope="module")
def images(root: Path) -> list[Path]:
    return [frame.path for frame in open_observations(root).frames]


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_a_folder_of_observations_gives_a_table_in_its_own_order(
    command: CommandLine, root: Path
) -> None:
    ended = command(root, "--repeats", "2")
    assert ended.status == 0
    assert "4 estimates in estimates_exact_fit.csv" in ended.out
    rows = table(Path("estimates_exact_fit.csv"))
    assert [row["frame_id"] for row in rows] == [f.frame_id for f in open_observations(root).frames]
    assert {row["outcome"] for row in rows} == {"contact"}
    again = command(root).out
    assert "4 estimates in estimates_exact_fit.csv, replacing the one before" in again
    heads = next(line for line in again.splitlines() if "frame_id" in line)
    assert "…" not in heads


@pytest.mark.parametrize(("package", "module"), [("solver", "cv2"), ("vbaa_bench", "typer")])
def test_a_python_without_the_packages_says_so(package: str, module: str) -> None:
    words = [sys.executable, "-S", "-m", package, "demo"]
    root = Path(__file__).parents[3]
    ended = subprocess.run(words, cwd=root, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"error: {module} is not installed: pip install ")


def test_no_output_replaces_an_input(command: CommandLine, root: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig"
    shutil.copytree(root, rig)
    shard = next(rig.glob("shard_*"))
    link = tmp_path / "link.csv"
    link.symlink_to(shard / "metadata.csv")
    before = {path: path.read_bytes() for path in rig.rglob("*") if path.is_file()}
    for out in (rig / "rig.json", rig / "rest" / "rest_00.png", shard / "metadata.csv", link):
        assert "is read by this command" in command.refused(rig, "--out", out)
        assert "is read by this command" in command.refused("learn", rig, "--out", out)
    for folder in (rig, rig / "rest", shard):
        assert "which is read by this command" in command.refused(rig, "--overlay", folder)
    picture = next(shard.glob("*.png"))
    refused = command.refused(picture, "--rig", rig, "--overlay", picture)
    assert "is read by this command" in refused
    board = command.refused("board", rig / "rig.json", "--rig", rig)
    assert "is read by this command" in board
    assert "is read by this command" in command.refused("snap", picture, picture)
    assert before == {path: path.read_bytes() for path in rig.rglob("*") if path.is_file()}
    kept = rig / "rest" / "rest_00.png"
    assert command("snap", picture, tmp_path / "new.png").err.endswith("new.png written\n")
    assert command("snap", picture, kept).err.endswith("rest_00.png replaced\n")


def test_a_rig_that_contradicts_its_images_is_a_warning(
    command: CommandLine, root: Path, antenna: Antenna, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wrong squares scale the forces: the uncertainty of EI alone would be no fair statement."""
    wrong = replace(antenna, rig=longer(antenna.rig))
    monkeypatch.setattr("solver.lab.command_line.set_up", lambda *_: wrong)
    found = findings(wrong)
    assert found
    ended = command(root)
    assert ended.status == 0
    for finding in found:
        assert f"warning: {finding.message}\n" in ended.err
    assert f"run python -m solver check --rig {root}" in ended.err
    assert "warning" not in ended.out
    assert "expect forces" not in ended.out
    streamed = command(root, "--stream")
    assert f"warning: {found[0].message}" in streamed.err
    assert all(json.loads(line) for line in streamed.out.splitlines())
    assert command(root, "--quiet") == (0, "", "")


def longer(rig: Rig) -> Rig:
    return replace(rig, beam=replace(rig.beam, length=1.2 * rig.beam.length))


def test_images_and_a_rig_give_what_the_folder_gives(
    command: CommandLine, root: Path, images: list[Path]
) -> None:
    assert command(root, "--quiet", "--out", "whole.csv").status == 0
    ended = command(*images, "--rig", root / "rig.json", "--quiet", "--out", "single.csv")
    assert ended == (0, "", "")
    for one, other in zip(table(Path("whole.csv")), table(Path("single.csv")), strict=True):
        assert Path(other["frame_id"]).stem == one["frame_id"]
        assert other["x_c_mm"] == one["x_c_mm"]


def test_a_rig_folder_is_a_source_of_its_images(command: CommandLine, root: Path) -> None:
    assert command(root, "--quiet", "--out", "whole.csv").status == 0
    ended = command(root, "--rig", root, "--quiet", "--out", "folder.csv")
    assert ended == (0, "", "")
    frame_ids = [
        [row["frame_id"] for row in table(Path(name))] for name in ("whole.csv", "folder.csv")
    ]
    assert frame_ids[0] == frame_ids[1]


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
def test_a_stream_is_json_and_nothing_else(
    command: CommandLine, root: Path, images: list[Path]
) -> None:
    colour = cv2.cvtColor(read_grey(images[0]), cv2.COLOR_GRAY2BGR)
    cv2.imwrite("colour.png", colour)
    readings: list[str | Path] = ["--readings", images[0].parent / "metadata.csv"]
    ended = command("colour.png", *images[:1], "--rig", root, "--stream", "--overlay", "seen")
    assert (ended.status, ended.err) == (0, "")
    said = [json.loads(line) for line in ended.out.splitlines()]
    assert [one["frame"] for one in said] == [0, 1]
    assert said[0]["name"] == "colour.png"
    assert said[0]["x_c_mm"] == said[1]["x_c_mm"]  # colour changes nothing
    assert all(one["latency_ms"] > 0 for one in said)
    assert len(list(Path("seen").glob("*.png"))) == 2
    assert not list(Path().glob("*.csv"))
    assert "colour.png" in command.refused("colour.png", "--rig", root, *readings)
    assert command(*images[:1], "--rig", root, "--stream", *readings).status == 0


@pytest.mark.thorough
def test_a_video_in_and_a_video_out(command: CommandLine, root: Path, images: list[Path]) -> None:
    writer = cv2.VideoWriter("in.avi", cv2.VideoWriter.fourcc(*"FFV1"), 10, (512, 176))
    for path in images:
        writer.write(cv2.cvtColor(read_grey(path), cv2.COLOR_GRAY2BGR))
    writer.release()
    ended = command("in.avi", "--rig", root, "--stream", "--overlay", "out.mp4", "--out", "v.csv")
    assert ended.status == 0
    said = [json.loads(line) for line in ended.out.splitlines()]
    assert [one["time_s"] for one in said] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert command(*images, "--rig", root, "--quiet", "--out", "images.csv").status == 0
    for one, other in zip(said, table(Path("images.csv")), strict=True):
        assert one["outcome"] == other["outcome"]
        # A lossless video in YUV keeps gray to within a level.
        assert one["x_c_mm"] == pytest.approx(float(other["x_c_mm"]), abs=0.5)
    assert len(table(Path("v.csv"))) == 4
    capture = cv2.VideoCapture("out.mp4")
    assert int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) == 4
    assert capture.get(cv2.CAP_PROP_FPS) == 10
    # A video that is cut: what it shows is estimated, and the end is not silent.
    writer = cv2.VideoWriter("long.avi", cv2.VideoWriter.fourcc(*"FFV1"), 10, (512, 176))
    for path in 3 * images:
        writer.write(cv2.cvtColor(read_grey(path), cv2.COLOR_GRAY2BGR))
    writer.release()
    content = Path("long.avi").read_bytes()
    Path("cut.avi").write_bytes(content[: len(content) * 6 // 10])
    ended = command("cut.avi", "--rig", root, "--out", "cut.csv")
    assert ended.status == 1
    count = len(table(Path("cut.csv")))
    assert 4 < count < 9
    assert f"cut.avi: ends after {count} of 12 frames" in ended.err.replace("\n", " ")


class Plugged:
    """A camera that shows images in turn, 50 a second, until its cable is pulled."""

    def __init__(self, images: list[Path]) -> None:
        self._images = [cv2.cvtColor(read_grey(path), cv2.COLOR_GRAY2BGR) for path in images]

    def read(self) -> tuple[bool, object]:
        time.sleep(0.02)
        return bool(self._images), self._images.pop(0) if self._images else None

    def get(self, _prop: int) -> float:
        return 50.0

    def release(self) -> None:
        self._images = []


@pytest.mark.thorough
@pytest.mark.parametrize("words", [["--stream", "--out", "kept.csv"], ["--out", "kept.csv"]])
def test_a_camera_is_read_until_it_is_lost(
    command: CommandLine,
    root: Path,
    images: list[Path],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
) -> None:
    monkeypatch.setattr("solver.lab.sources.open_capture", lambda _address: Plugged(images * 5))
    ended = command("0", "--rig", root, *words)
    assert ended.status == 2
    assert ended.err.endswith("error: camera 0 gives no more images\n")
    kept = table(Path("kept.csv"))
    assert 1 < len(kept) <= 20
    if "--stream" not in words:
        assert ended.out == ""
        return
    said = [json.loads(line) for line in ended.out.splitlines()]
    assert [str(one["frame"]) for one in said] == [row["frame_id"] for row in kept]
    assert len(said) + sum(one["skipped"] for one in said) == said[-1]["frame"] + 1
    times = [one["time_s"] for one in said]
    assert times == sorted(times)


def test_a_mistake_is_one_sentence(command: CommandLine, root: Path, images: list[Path]) -> None:
    rig: list[str | Path] = ["--rig", root / "rig.json"]
    Path("root/images").mkdir(parents=True)
    shutil.copy(images[0], "root/images")
    assert "images, a video or a camera need --rig" in command.refused(*images)
    assert "nowhere: does not exist" in command.refused("nowhere")
    assert "nowhere.png: does not exist" in command.refused("nowhere.png")
    assert "video or a camera need --rig" in command.refused("0")
    assert "; give the rig by --rig rig" in command.refused("check", "rig")
    assert "; give the rig by --rig rig" in command.refused("check", "--json", "rig")
    assert "warm has no argument 'rig'" in command.refused("warm", *rig, "rig")
    assert "root: is a folder, list its images:" in command.refused("root", *rig, "--readings", "x")
    assert "none.json: cannot be read" in command.refused(images[0], "--rig", "none.json")
    assert "none.png: does not exist" in command.refused("none.png", *rig)
    assert "camera 97: cannot be opened" in command.refused("97", *rig, "--stream")
    assert "method 'magic' is unknown" in command.refused(images[0], *rig, "--method", "magic")
    assert "folder of observations has its own" in command.refused(root, "--readings", "x.csv")
    shutil.copytree(root, "lab", ignore=shutil.ignore_patterns(HASHES))
    shutil.rmtree("lab/rest")
    assert "holds no rest/rest_*.png" in command.refused(images[0], "--rig", "lab/rig.json")
    Path("broken.mp4").write_text("no video")
    ended = command("broken.mp4", *rig)
    assert (ended.status, ended.out) == (2, "")
    # FFmpeg writes a line of its own before ours.
    assert ended.err.splitlines()[-1].startswith("error: broken.mp4: cannot be opened")
    Path("blocked").write_text("")
    assert "cannot be written" in command.refused(images[0], *rig, "--overlay", "blocked")
    refused = command.refused(*images[:2], *rig, "--overlay", "seen.png")
    assert "seen.png: is a single image, allowed for 2 images is a folder" in refused
    assert "did you mean 'check'?" in command.refused("chek", *rig)


def test_a_bad_image_is_a_row_and_not_the_end(
    command: CommandLine, root: Path, images: list[Path]
) -> None:
    Path("small.png").write_bytes(png_bytes(np.zeros((40, 50), np.uint8)))
    Path("text.png").write_text("no image")
    names: list[str | Path] = [images[0], "small.png", images[1], "text.png"]
    out = Path("new/folder/kept.csv")
    ended = command(*names, "--rig", root, "--quiet", "--out", out, "--overlay", "seen")
    assert ended == (0, "", "")
    rows = table(out)
    assert [row["outcome"] for row in rows] == ["contact", "invalid", "contact", "invalid"]
    assert "the image has 50 x 40 px" in rows[1]["message"]
    assert "text.png: is not an image" in rows[3]["message"]
    # Nothing is drawn where nothing was seen.
    assert [path.name[:6] for path in sorted(Path("seen").iterdir())] == ["000000", "000002"]


def test_a_place_that_cannot_be_written_is_told_before_anything_is_solved(
    command: CommandLine, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("solver.lab.command_line.set_up", lambda *_: pytest.fail("it has begun"))
    Path("blocked").write_text("")
    Path("folder.csv").mkdir()
    for out in ("blocked/out.csv", "folder.csv"):
        assert f"{out}: cannot be written" in command.refused(root, "--out", out)


@pytest.mark.thorough
@pytest.mark.parametrize("centreline", EXTRACTORS)
def test_the_beam_is_measured_as_was_asked_for(
    command: CommandLine, root: Path, images: list[Path], centreline: str
) -> None:
    options = ["--method", "linear_fit", "--centreline", centreline, "--stream"]
    ended = command(images[0], "--rig", root, *options)
    assert (ended.status, ended.err) == (0, "")
    said = json.loads(ended.out)
    assert said["outcome"] == "contact"
    # Linear theory errs by some millimetres at large deflections, whatever measures the beam.
    assert min(abs(said["x_c_mm"] - place) for place in (100, 200)) < 15


def test_an_unknown_centreline_is_named(command: CommandLine, root: Path) -> None:
    said = command.refused(root, "--centreline", "magic")
    assert "centreline 'magic' is unknown, allowed is one of profile_fit, background_sub" in said


def test_a_check_says_how_good_the_calibration_is(command: CommandLine, root: Path) -> None:
    ended = command("check", "--rig", root, "--json")
    assert (ended.status, ended.err) == (0, "")
    found = json.loads(ended.out)
    assert 0 < found["reprojection_px"] < 0.1
    assert found["viewpoint_known"] is True
    assert abs(found["height_mm"] - 360) < MOST_SIGMAS * found["height_sigma_mm"]
    assert 0 < found["height_sigma_mm"] < 2
    assert found["focal_sigma"] < 0.01 * found["focal"]
    assert (found["beam"], found["bow_mm"]) == ("bright", 0)
    assert found["width_px"] == pytest.approx(0.8 / found["pixel_mm"], rel=0.3)
    assert abs(found["rest_y_mm"]) < 0.05
    assert found["noise_dark"] + found["noise_per_gray"] > 0
    ended = command("check", "--rig", root)
    assert f"{found['height_mm']:.2f} +- " in ended.out
    assert ended.out.splitlines()[-1].split(maxsplit=1) == ["assessment", found["meaning"]]
    assert found["meaning"].startswith("good")


def test_a_check_with_a_warning_exits_with_1(command: CommandLine, root: Path) -> None:
    shutil.copytree(root, "lab", ignore=shutil.ignore_patterns(HASHES))
    Path("lab/rest/ruhe.png").write_bytes(b"")
    for as_json in ([], ["--json"]):
        ended = command("check", "--rig", "lab/rig.json", *as_json)
        assert (ended.status, ended.err) == (1, "")
        assert "warning: not used: rest/ruhe.png" in ended.out


INTERRUPTED = """
from solver.methods import METHODS

def third(measurement, count=[0]):
    count[0] += 1
    if count[0] == 7:  # the first four are the warm-up
        raise KeyboardInterrupt
    return METHODS["exact_fit"](measurement)
"""


def test_what_was_solved_before_an_interrupt_is_kept(
    command: CommandLine, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("pressed_ctrl_c.py").write_text(INTERRUPTED)
    monkeypatch.syspath_prepend(str(Path.cwd()))
    ended = command(root, "--method", "pressed_ctrl_c:third", "--quiet", "--out", "kept.csv")
    assert ended == (130, "", "interrupted: the estimates so far are kept\n")
    assert len(table(Path("kept.csv"))) == 2


@pytest.mark.thorough
def test_a_stream_that_nobody_reads_any_more_ends_quietly(
    root: Path, images: list[Path], tmp_path: Path
) -> None:
    words = [*map(str, images * 500), "--rig", str(root), "--stream"]
    with subprocess.Popen(
        [sys.executable, "-m", "solver", *words],
        cwd=tmp_path,
        env={"PYTHONPATH": str(Path(__file__).parents[3]), "PATH": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert json.loads(process.stdout.readline())["frame"] == 0
        process.stdout.close()
        assert process.stderr.read() == ""


def test_the_board_of_a_rig_is_drawn(command: CommandLine, root: Path) -> None:
    assert command("board", "board.svg", "--rig", root) == (0, "", "written to board.svg\n")
    assert Path("board.svg").read_text().startswith("<svg")
    assert command("board", "new/board.svg", "--rig", root) == (0, "", "written to new/board.svg\n")
    assert "cannot be written" in command.refused("board", "board.svg/x.svg", "--rig", root)


def test_the_readme_starts_with_a_rig_that_can_be_read(command: CommandLine) -> None:
    text = (Path(__file__).parents[3] / "solver" / "README.md").read_text(encoding="utf-8")
    Path("rig.json").write_text(text.split("```json")[1].split("```")[0])
    assert command("board", "board.svg", "--rig", "rig.json") == (0, "", "written to board.svg\n")
    # The card fits on a sheet of A4.
    assert 'width="280.0000mm" height="192.0000mm"' in Path("board.svg").read_text()


def test_an_image_is_kept_in_gray(command: CommandLine, images: list[Path]) -> None:
    grey = read_grey(images[0])
    cv2.imwrite("colour.jpg", cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    assert command("snap", "colour.jpg", "rig/rest/rest_00.png").status == 0
    assert command("snap", "colour.jpg", images[1], "rig/view_08.png").status == 0
    assert sorted(path.name for path in Path("rig").glob("*.png")) == ["view_08.png", "view_09.png"]
    kept = read_grey(Path("rig/rest/rest_00.png"))
    assert kept.shape == grey.shape
    assert np.abs(kept.astype(int) - grey).mean() < 3
    assert "camera 97: cannot be opened" in command.refused("snap", "97", "x.png")


class Settling:
    """A camera whose exposure settles over its first frames."""

    def __init__(self) -> None:
        self._read = 0

    def read(self) -> tuple[bool, object]:
        time.sleep(0.001)
        self._read += 1
        colour = np.zeros((4, 6, 3), np.uint8)
        colour[:, :, 2] = min(8 * self._read, 200)
        return True, colour

    def get(self, _prop: int) -> float:
        return 0.0

    def release(self) -> None:
        pass


def test_the_first_frames_of_a_camera_are_not_kept(
    command: CommandLine, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("solver.lab.sources.open_capture", lambda _address: Settling())
    assert command("snap", "0", "kept.png", "--channel", "r").status == 0
    assert (read_grey(Path("kept.png")) == 200).all()
    assert command("snap", "0", "first.png", "--channel", "r", "--drop", "0").status == 0
    assert (read_grey(Path("first.png")) < 200).all()
    told = json.loads((root / "rig.json").read_text())
    told["camera"]["channel"] = "g"
    Path("rig.json").write_text(json.dumps(told))
    assert command("snap", "0", "green.png", "--rig", "rig.json").status == 0
    assert not read_grey(Path("green.png")).any()
    assert "allowed is one of gray, r, g, b, lab_b" in command.refused(
        "snap", "0", "x.png", "--channel", "c"
    )


def under_weight(
    observations: Observations, camera: Camera, rigidity: float, force: float, at: float
) -> Grey:
    """Draw the rig's beam with a weight on it, as wide and as bright as at rest."""
    beam = observations.rig.beam
    at_rest = read_grey(observations.rest_images[0]).astype(float)
    ground = float(np.median(at_rest))
    shape = hung_beam(force / rigidity, 0.0, at, 0.0, beam.length)
    assert shape is not None
    x = np.linspace(0.0, shape.x[-1], 4000)
    line = camera.project(np.column_stack([x, shape(x), np.zeros_like(x)]))
    u = np.arange(camera.width)
    v = np.interp(u, line[:, 0], line[:, 1])
    beside = (u < line[0, 0]) | (u > line[-1, 0])
    width = beam.diameter * camera.pixels_per_metre(np.zeros((1, 3)))[0]
    sub = (np.arange(16) + 0.5) / 16 - 0.5
    off = (np.arange(camera.height)[:, None, None] + sub) - v[None, :, None]
    # A round beam is brightest along its middle.
    profile = 4 / np.pi * np.sqrt((1 - (2 * off / width) ** 2).clip(0)).mean(axis=2)
    profile[:, beside] = 0.0
    row = at_rest[:, 200].argmax()
    bright = (at_rest[row - 3 : row + 4, 200] - ground).sum() / width
    noise = 0.7 * generator(__name__, 2).standard_normal(profile.shape)
    return np.asarray((ground + bright * profile + noise).round().clip(0, 255), np.uint8)


def test_a_start_in_advance_says_how_long_it_took(command: CommandLine, root: Path) -> None:
    ended = command("warm", "--rig", root)
    assert (ended.status, ended.out) == (0, "")
    assert "ready after" in ended.err


def test_rigidity_needs_a_weight(command: CommandLine, root: Path, images: list[Path]) -> None:
    zero = ["--weight-g", "0", "--at-mm", "190"]
    assert "must be above 0" in command.refused("rigidity", images[0], "--rig", root, *zero)


def test_the_learned_method_learns_from_the_images_that_it_is_given(
    command: CommandLine,
    root: Path,
    images: list[Path],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[list[Path]] = []

    def keeps(_antenna: Antenna, frames: Sequence[ImageFrame]) -> LearnedBeam:
        given.append([frame.path for frame in frames])
        raise InputError("nothing is learned here")

    monkeypatch.setattr("solver.lab.command_line.learn_from_frames", keeps)
    learned = ["--method", "exact_fit_learned"]
    ended = command(*images, "--rig", root, "--quiet", "--out", "stated.csv", *learned)
    assert ended.status == 0
    assert given == [images]
    # Never worse than not learning: the estimates are those with the stated beam, and say so.
    assert command(*images, "--rig", root, "--quiet", "--out", "exact.csv").status == 0
    said = "with the stated beam, because none was learned: nothing is learned here"
    for stated, exact in zip(table(Path("stated.csv")), table(Path("exact.csv")), strict=True):
        assert stated["message"].startswith(said)
        assert stated["x_c_mm"] == exact["x_c_mm"]
    monkeypatch.setattr("solver.lab.sources.open_capture", lambda _address: Plugged(images))
    assert "a camera or video has none" in command.refused("0", "--rig", root, *learned)


@pytest.mark.thorough
def test_a_contact_is_no_hung_weight(command: CommandLine, root: Path, images: list[Path]) -> None:
    words = ["--weight-g", "4", "--at-mm", "190"]
    refused = command.refused("rigidity", images[0], "--rig", root, *words)
    # Which of the two is named depends on where the object happens to be.
    reasons = "only the weight may bend the beam", "check its stated place"
    assert "sigma" in refused
    assert any(reason in refused for reason in reasons)


@pytest.mark.thorough
def test_a_hung_weight_gives_ei(
    command: CommandLine, root: Path, observations: Observations, antenna: Antenna
) -> None:
    nominal, camera = observations.rig.beam.flexural_rigidity, antenna.calibration.camera
    picture = under_weight(observations, camera, 1.06 * nominal, 4e-3 * 9.807, 0.19)
    Path("hung.png").write_bytes(png_bytes(picture))
    rig = root / "rig.json"
    words: list[str | Path] = ["rigidity", "hung.png", "--rig", rig, "--weight-g", "4"]
    ended = command(*words, "--at-mm", "190")
    assert (ended.status, ended.err) == (0, "")
    value, sigma = (
        float(line.split(":")[1].rstrip(","))
        for line in ended.out.splitlines()
        if line.strip().startswith('"flexural_rigidity')
    )
    assert abs(value - 1.06e6 * nominal) < MOST_SIGMAS * sigma
    assert sigma < 0.006 * value
    assert 5 < float(ended.out.split("(")[1].split("%), ")[1].split(" %")[0]) < 7
    assert "hangs at 300 mm" in command.refused(*words, "--at-mm", "300")
