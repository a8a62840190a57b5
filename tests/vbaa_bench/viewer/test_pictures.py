"""Pictures of frames: one frame, animations and the contact sheet."""

import io
from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.instrument.errors import InputError
from tests.vbaa_bench.stored import store
from vbaa_bench.report.gallery import TRUTH, Colours, colours_of
from vbaa_bench.viewer import animation
from vbaa_bench.viewer.animation import gif, mp4
from vbaa_bench.viewer.drawn_frame import draw_frame
from vbaa_bench.viewer.ellipses import ellipse_plot
from vbaa_bench.viewer.frames import ViewedDataset, open_frames
from vbaa_bench.viewer.sheet import contact_sheet


def near(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Number of pixels of nearly this colour."""
    return int((np.abs(picture.astype(int) - colour).max(axis=2) < 30).sum())


def pictures(viewed: ViewedDataset, colours: Colours) -> list[np.ndarray]:
    plot = ellipse_plot(viewed.predictions)
    return [draw_frame(frame, colours, plot) for frame in viewed]


def test_a_picture_has_truth_and_estimates(viewed: ViewedDataset) -> None:
    colours = colours_of(list(viewed.predictions))
    drawn = pictures(viewed, colours)
    assert len({picture.shape for picture in drawn}) == 1
    assert all(near(picture, TRUTH) > 300 for picture in drawn)
    # The table's dot alone, if there is no estimate.
    with_ring, without = (near(drawn[i], colours["mine"]) for i in (2, 3))
    assert with_ring > without + 50 > 100


def test_a_gif_has_all_frames(viewed: ViewedDataset, tmp_path: Path) -> None:
    done: list[int] = []
    path = tmp_path / "v.gif"
    path.write_bytes(gif(viewed, done.append))
    success, read = cv2.imreadanimation(str(path))
    assert success
    assert len(read.frames) == 4
    assert done == [1, 2, 3, 4]
    drawn = pictures(viewed, colours_of(list(viewed.predictions)))
    size = read.frames[1].shape[1::-1]
    expected = cv2.resize(drawn[1], size, interpolation=cv2.INTER_AREA)
    # A GIF has 256 colours; others are mixed of them.
    pair = (read.frames[1][:, :, :3], expected)
    blurred, smooth = (cv2.blur(one.astype(np.float64), (15, 15)) for one in pair)
    assert np.abs(blurred - smooth).mean() < 3


def test_too_many_frames_for_a_gif_are_refused(
    viewed: ViewedDataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(animation, "MAX_GIF_FRAMES", 3)
    with pytest.raises(InputError, match=r"4 frames are selected, allowed are 3 in a GIF"):
        gif(viewed, lambda _done: None)


def test_a_video_has_all_frames(viewed: ViewedDataset) -> None:
    av = pytest.importorskip("av")
    content = io.BytesIO(mp4(viewed, lambda _done: None))
    with av.open(content) as container:
        decoded = [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]
    assert len(decoded) == 4
    drawn = pictures(viewed, colours_of(list(viewed.predictions)))
    height, width = decoded[3].shape[:2]
    assert np.abs(decoded[3].astype(float) - drawn[3][:height, :width]).mean() < 4


def test_a_video_without_pyav_is_refused(
    viewed: ViewedDataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(InputError, match=r"a video needs the extra 'vbaa-bench\[video\]'"):
        mp4(viewed, lambda _done: None)


@pytest.mark.thorough
def test_a_contact_sheet_has_a_tile_per_frame(viewed: ViewedDataset, predicted: Path) -> None:
    sheets = [
        cv2.imdecode(np.frombuffer(contact_sheet(data, lambda _done: None), np.uint8), 1)
        for data in (viewed, open_frames(predicted, slice(2)))
    ]
    four, two = (sheet for sheet in sheets if sheet is not None)
    assert four.shape[1] > two.shape[1]  # three columns and two
    assert four.shape[0] > 1.7 * (two.shape[0] - 40)
    assert near(four, TRUTH) > 1.5 * near(two, TRUTH) > 150


def test_a_dataset_without_contact_or_predictions(tmp_path: Path) -> None:
    data = open_frames(store(tmp_path / "set", frames=2), slice(None))
    assert data.predictions == {}
    drawn = pictures(data, {})
    assert drawn[0].shape == drawn[1].shape
    assert contact_sheet(data, lambda _done: None).startswith(b"\x89PNG")
