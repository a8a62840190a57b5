"""A rig whose images have 12 bits in 16, lower or upper, dim or not, answers as that of 8 does."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.antenna import Antenna
from solver.instrument.arrays import Grey
from solver.instrument.images import png_bytes, read_grey
from solver.instrument.observation import Observations, open_observations
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker


def rewritten(
    root: Path, to: Path, change: Callable[[Grey], Grey], **camera: object
) -> Observations:
    shutil.copytree(root, to, ignore=shutil.ignore_patterns("hashes.json"))
    for path in to.rglob("*.png"):
        path.write_bytes(png_bytes(change(read_grey(path))))
    told = json.loads((to / "rig.json").read_text())
    told["camera"] |= camera
    (to / "rig.json").write_text(json.dumps(told))
    return open_observations(to)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("change", "camera"),
    [
        (lambda image: image.astype(np.uint16) << 8, {}),
        (lambda image: image.astype(np.uint16) << 8, {"bits": 8}),
        (lambda image: image.astype(np.uint16), {"bits": 12}),
    ],
    ids=["upper", "upper, stated", "dim, stated"],
)
def test_bits_change_nothing(
    observations: Observations,
    antenna: Antenna,
    tmp_path: Path,
    change: Callable[[Grey], Grey],
    camera: dict[str, object],
) -> None:
    deep = rewritten(observations.root, tmp_path / "deep", change, **camera)
    method = METHODS["exact_fit"]
    one = PushTracker(antenna, method).solve(observations.frames[1].image()).estimate
    other = PushTracker(set_up(deep), method).solve(deep.frames[1].image()).estimate
    assert other.outcome is one.outcome
    assert other.values["x_c_m"] == pytest.approx(one.values["x_c_m"], abs=1e-7)


def test_frames_of_sixteen_bits_on_a_rig_of_eight_are_named(
    observations: Observations, antenna: Antenna
) -> None:
    deep = observations.frames[1].image().astype(np.uint16) * 257
    said = PushTracker(antenna, METHODS["exact_fit"]).solve(deep).estimate.message
    assert "are not in the lower 8 of its 16 bits" in said


def test_images_at_rest_are_read_in_the_rigs_channel(
    observations: Observations, antenna: Antenna, tmp_path: Path
) -> None:
    told = rewritten(observations.root, tmp_path / "red", lambda image: image, channel="r")
    for path in (*told.rest_images, told.frames[1].path):
        grey = read_grey(path)
        cv2.imwrite(str(path), np.dstack([0 * grey, 0 * grey, grey]))
    method = METHODS["exact_fit"]
    one = PushTracker(antenna, method).solve(observations.frames[1].image()).estimate
    other = PushTracker(set_up(told), method).solve(told.frames[1].image()).estimate
    assert other.values["x_c_m"] == one.values["x_c_m"]
