import math
import shutil
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from solver.__main__ import main
from solver.antenna import Antenna
from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import Observations, open_observations
from solver.instrument.rig_json import read_rig
from solver.learning.frames import frames_to_learn, learn_from_frames, with_learned
from solver.learning.learn import LearnedBeam
from solver.learning.page import widths_of
from vbaa_bench.scoring.isolation.runs import applicable


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["solver", *arguments])
    try:
        main()
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


@pytest.mark.thorough
def test_the_beam_of_rendered_images_is_learned(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    observations, out, page = dataset / "observations", tmp_path / "rig.json", tmp_path / "p.html"
    frame = next(iter(open_observations(observations)))
    force = ("--known-force", frame.frame_id, "0.05", "0.001")
    arguments = ("learn", str(observations), "--out", str(out), "--page", str(page), *force)
    assert run(monkeypatch, *arguments) == 0
    rig = read_rig(out)
    assert len(rig.shape.bow) == 3
    width, sigma = widths_of(rig.shape)
    assert (np.abs(width - 1) <= 4 * sigma + 1e-12).all()
    assert "<svg" in page.read_text(encoding="utf-8")
    assert "from the 4 of 4 frames" in page.read_text(encoding="utf-8")
    # The frame of the known force has this force now.
    assert rig.tolerances.flexural_rigidity / rig.beam.flexural_rigidity < 0.05
    wrong = ("--known-force", "nothing", "0.05", "0.001")
    assert run(monkeypatch, "learn", str(observations), "--out", str(out), *wrong) == 2
    weight = ("--hung-weight", frame.frame_id, "4", "0.01")
    assert run(monkeypatch, "learn", str(observations), "--out", str(out), *weight, *force) == 2
    one_file = ("learn", str(observations), "--out", str(page), "--page", str(page))
    assert run(monkeypatch, *one_file) == 2


def test_frames_to_learn_are_those_of_the_split(observations: Observations) -> None:
    assert frames_to_learn(observations.frames) == list(observations.frames)
    assert "exact_fit_learned" not in applicable(observations)
    marked = [
        replace(frame, split="learn" if i % 2 else "test")
        for i, frame in enumerate(observations.frames)
    ]
    assert frames_to_learn(marked) == marked[1::2]
    with pytest.raises(InputError, match="no frame has the split 'learn'"):
        frames_to_learn(marked[::2])
    assert "exact_fit_learned" in applicable(replace(observations, frames=tuple(marked)))


def test_images_that_cannot_be_used_are_named(
    observations: Observations, antenna: Antenna, tmp_path: Path
) -> None:
    (tmp_path / "no_image.png").write_bytes(b"xx")
    broken = replace(observations.frames[0], frame_id="broken", path=tmp_path / "no_image.png")
    named = dict[str, str]()

    def left_out(frame: ImageFrame, reason: str) -> None:
        named[frame.frame_id] = reason

    beam = learn_from_frames(antenna, [broken, *observations.frames], None, left_out)
    assert list(named) == ["broken"]
    assert "no_image.png" in named["broken"]
    assert (beam.frames, beam.measured) == (4, 4)
    with pytest.raises(InputError, match=r"no_image\.png"):
        learn_from_frames(antenna, [broken])


def test_a_learned_antenna_measures_with_the_learned_beam(
    observations: Observations, antenna: Antenna
) -> None:
    beam = learn_from_frames(antenna, observations.frames)
    learned = with_learned(antenna, beam)
    assert learned.rig.shape is beam.shape
    assert antenna.rig.shape.uniform
    assert beam.frames == len(observations.frames)


def laboratory(observations: Observations, root: Path) -> Path:
    """A folder as a laboratory has it: the rig, its images, and all frames in images/."""
    for part in ("calibration", "rest"):
        shutil.copytree(observations.root / part, root / part)
    shutil.copy(observations.root / "rig.json", root)
    (root / "images").mkdir()
    rows = ["file_name,motor_angle_deg,push_id,step"]
    for frame in observations.frames:
        shutil.copy(frame.path, root / "images")
        angle = math.degrees(frame.readings.motor_angle or 0.0)
        rows.append(f"{frame.path.name},{angle!r},{frame.push_id},{frame.step}")
    (root / "images" / "metadata.csv").write_text("\n".join(rows), encoding="utf-8")
    return root


def test_learn_takes_images_with_readings_or_a_laboratorys_folder(
    observations: Observations,
    antenna: Antenna,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    given: list[list[ImageFrame]] = []

    def keeps(_antenna: Antenna, frames: Iterable[ImageFrame], *_: object) -> LearnedBeam:
        given.append(list(frames))
        raise InputError("nothing is learned here")

    monkeypatch.setattr("solver.lab.learn_command.set_up", lambda *_: antenna)
    monkeypatch.setattr("solver.lab.learn_command.learn_from_frames", keeps)
    root = laboratory(observations, tmp_path)
    images, table = sorted(map(str, root.glob("images/*.png"))), str(root / "images/metadata.csv")
    out = ("--out", str(tmp_path / "learned.json"))
    (root / "rest" / "rest1.png").write_bytes(b"")
    assert run(monkeypatch, "learn", str(root), *out) == 2
    assert "warning: not used: rest/rest1.png" in capfd.readouterr().err
    assert run(monkeypatch, "learn", *images, "--rig", str(root), "--readings", table, *out) == 2
    assert run(monkeypatch, "learn", *images, "--rig", str(root), *out) == 2
    said = capfd.readouterr().err
    assert said.count("nothing is learned here") == 2
    expected = {f.path.name: (f.push_id, f.readings.motor_angle) for f in observations.frames}
    for frames in given[:2]:
        pushes = {f.path.name: (f.push_id, f.readings.motor_angle) for f in frames}
        assert pushes.keys() == expected.keys()
        for name, (push, angle) in expected.items():
            assert pushes[name][0] == push
            assert pushes[name][1] == pytest.approx(angle, abs=1e-12)
    assert {f.path.name: f.push_id for f in given[2]} == dict.fromkeys(expected, "")
    (tmp_path / "film.avi").write_bytes(b"")
    empty = SimpleNamespace(get=lambda _property: 25.0)
    monkeypatch.setattr("solver.lab.sources.open_capture", lambda _name: empty)
    film = ("learn", str(tmp_path / "film.avi"), "--rig", str(root), *out)
    assert run(monkeypatch, *film) == 2
    assert "learn needs images of pushes" in capfd.readouterr().err
