"""Where images come from: order, gray, the newest frame, and clear words where there is none."""

import math
import queue
import shutil
import struct
import threading
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from solver.instrument.errors import IncompleteError, InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import png_bytes, read_grey
from solver.instrument.metadata import read_frames
from solver.instrument.observation import open_observations, open_rig_files
from solver.lab.capture import CameraStream, Video
from solver.lab.controls import Controls
from solver.lab.shots import Files
from solver.lab.sources import open_source


def test_frames_come_push_by_push_and_step_by_step(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    laid = [("p", 2), ("q", 1), ("p", 0), ("q", 0), ("p", 1)]
    frames = [ImageFrame(f"{push}{step}", path, push_id=push, step=step) for push, step in laid]
    shots = list(Files(frames))
    assert [shot.name for shot in shots] == ["p0", "p1", "p2", "q0", "q1"]
    assert [shot.number for shot in shots] == [2, 4, 0, 3, 1]  # where each was laid
    alone = [ImageFrame(name, path) for name in "cab"]
    assert [shot.name for shot in Files(alone)] == ["c", "a", "b"]  # as named: no push, no step


def test_an_image_that_is_none_is_a_shot_with_its_fault(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no image")
    good = tmp_path / "good.png"
    good.write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    bad, shot = open_source([str(tmp_path / "text.png"), str(good)])
    assert bad.image is None
    assert bad.fault.endswith("text.png: is not an image that can be decoded")
    with pytest.raises(InputError, match=r"text\.png: is not an image"):
        bad.pixels()
    assert shot.pixels().shape == (4, 5)
    assert not shot.fault


def test_a_frame_without_a_name_is_called_as_its_file(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("")
    (tmp_path / "b.png").write_text("")
    table = tmp_path / "metadata.csv"
    table.write_text("file_name,motor_angle_deg\na.png,30\n")
    frame = next(read_frames(table))
    assert frame.frame_id == "a"
    assert frame.readings.motor_angle == pytest.approx(math.pi / 6)
    table.write_text("file_name,frame_id\na.png,\nb.png,mine\n")
    assert [frame.frame_id for frame in read_frames(table)] == ["a", "mine"]


class Scripted:
    """A camera that shows what is put into its queue, and is lost at None."""

    def __init__(self) -> None:
        self.frames: queue.Queue[int | None] = queue.Queue()
        self.all_fetched = threading.Event()
        self.released = False

    def read(self) -> tuple[bool, Any]:
        if self.frames.empty():
            self.all_fetched.set()
        value = self.frames.get()
        return value is not None, np.full((2, 2, 3), value or 0, np.uint8)

    def get(self, prop: int) -> float:
        return 30.0 if prop == cv2.CAP_PROP_FPS else 0.0

    def release(self) -> None:
        self.released = True

    def show(self, *values: int | None) -> None:
        self.all_fetched.clear()
        for value in values:
            self.frames.put(value)


def test_a_slow_reader_gets_the_newest_frame_and_is_told_what_it_missed() -> None:
    device = Scripted()
    camera = CameraStream("camera 0", device)
    assert (camera.live, camera.rate) == (True, 30.0)
    shots = iter(camera)
    device.show(10)
    first = next(shots)
    assert (first.number, first.skipped, int(first.pixels()[0, 0])) == (0, 0, 10)
    device.show(20, 30, 40)
    assert device.all_fetched.wait(10)
    late = next(shots)
    assert (late.number, late.skipped, int(late.pixels()[0, 0])) == (3, 2, 40)
    assert late.seconds is not None
    assert first.seconds is not None
    assert late.seconds >= first.seconds > 1.7e9
    assert late.taken >= first.taken
    device.show(None)
    with pytest.raises(InputError, match="camera 0 gives no more images"):
        next(shots)
    assert device.released


def video(path: Path, count: int = 5) -> Path:
    """A lossless gray video whose frame k has the value 40 k."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), 20, (64, 48))
    for number in range(count):
        writer.write(np.full((48, 64, 3), 40 * number, np.uint8))
    writer.release()
    return path


def test_a_video_shows_every_frame_with_its_time(tmp_path: Path) -> None:
    source = open_source([str(video(tmp_path / "a.avi"))])
    assert not source.live
    assert source.rate == 20
    shots = list(source)
    assert [shot.number for shot in shots] == [0, 1, 2, 3, 4]
    assert [shot.seconds for shot in shots] == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])
    assert [int(shot.pixels().mean()) for shot in shots] == pytest.approx(
        [0, 40, 80, 120, 160], abs=1
    )


@pytest.mark.parametrize("suffix", ["avi", "mkv"])
def test_a_cut_video_is_incomplete(
    tmp_path: Path, suffix: str, random: np.random.Generator
) -> None:
    path = tmp_path / f"whole.{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), 20, (64, 48))
    for _ in range(12):
        writer.write(random.integers(0, 255, (48, 64, 3), dtype=np.uint8))
    writer.release()
    whole = path.read_bytes()
    assert len(list(open_source([str(path)]))) == 12
    path.write_bytes(whole[: len(whole) * 6 // 10])
    shots = iter(open_source([str(path)]))
    assert [next(shots).number for _ in range(3)] == [0, 1, 2]
    with pytest.raises(IncompleteError, match=r"ends after \d of 12 frames: it is cut or damaged"):
        list(shots)


def turned(path: Path) -> Path:
    """A video that asks to be shown turned by 90 degrees."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10, (64, 48))
    for _ in range(3):
        writer.write(np.full((48, 64, 3), 90, np.uint8))
    writer.release()
    data = bytearray(path.read_bytes())
    # The track header's matrix, 44 bytes after its name (ISO/IEC 14496-12).
    matrix = data.index(b"tkhd") + 44
    assert struct.unpack_from(">9i", data, matrix) == (1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    struct.pack_into(">9i", data, matrix, 0, 1 << 16, 0, -1 << 16, 0, 0, 48 << 16, 0, 1 << 30)
    path.write_bytes(data)
    return path


def test_stills_and_videos_come_as_they_are_stored_whatever_their_tags(tmp_path: Path) -> None:
    path = turned(tmp_path / "turned.mp4")
    there, shown = cv2.VideoCapture(str(path)).read()
    assert there
    assert shown is not None
    assert shown.shape == (64, 48, 3)  # OpenCV obeys the tag
    assert next(iter(open_source([str(path)]))).pixels().shape == (48, 64)
    still = tmp_path / "turned.jpg"
    jpeg = bytes(cv2.imencode(".jpg", np.full((48, 64), 90, np.uint8))[1])
    # An EXIF block whose only entry is the orientation: turned by 90 degrees.
    entry = struct.pack("<HHIHH", 0x0112, 3, 1, 6, 0)
    tiff = b"II*\0" + struct.pack("<IH", 8, 1) + entry + struct.pack("<I", 0)
    exif = b"Exif\0\0" + tiff
    still.write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:])
    upright = cv2.imread(str(still))
    assert upright is not None
    assert upright.shape == (64, 48, 3)
    assert next(iter(open_source([str(still)]))).pixels().shape == (48, 64)


def test_the_channel_is_that_of_stills_videos_and_cameras(tmp_path: Path) -> None:
    colour = np.zeros((48, 64, 3), np.uint8)
    colour[:] = 30, 90, 200  # blue, green, red
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), colour)
    for channel, gray in (("b", 30), ("g", 90), ("r", 200), ("gray", 116)):
        shot = next(iter(open_source([str(path)], channel=channel)))
        assert (shot.pixels() == gray).all()
        moving = CameraStream("camera 0", Still(colour), channel)
        assert (next(iter(moving)).pixels() == gray).all()
        film = Video("film", Still(colour), channel)
        assert (next(iter(film)).pixels() == gray).all()


class Still:
    """A camera that shows one image for ever."""

    def __init__(self, image: Any) -> None:
        self._image = image

    def read(self) -> tuple[bool, Any]:
        time.sleep(0.001)
        return True, self._image

    def get(self, _prop: int) -> float:
        return 0.0

    def release(self) -> None:
        pass


def test_sources_that_are_not_there_are_named(tmp_path: Path) -> None:
    def refused(*names: str) -> str:
        with pytest.raises(InputError) as caught:
            open_source(names)
        return str(caught.value)

    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"not a video")
    assert "broken.mp4: cannot be opened" in refused(str(broken))
    assert "none.avi: does not exist" in refused(str(tmp_path / "none.avi"))
    assert "camera 97: cannot be opened" in refused("97")
    assert "a.png: does not exist" in refused("a.png", "b.png")
    assert "is a folder without images" in refused(str(tmp_path))
    image = tmp_path / "a.png"
    image.write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    assert "is a folder, list its images" in refused(str(tmp_path))
    assert "one video at a time" in refused(str(image), str(broken))


@pytest.mark.parametrize("suffix", [".tif", ".gif"])
def test_every_image_of_a_film_is_a_shot(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"film{suffix}"
    values = (0, 255, 0)
    if suffix == ".tif":
        cv2.imwritemulti(str(path), [np.full((8, 9), one, np.uint16) for one in values])
    else:
        film = cv2.Animation()
        film.frames = [np.full((8, 9, 4), (one, one, one, 255), np.uint8) for one in values]
        film.durations = [40] * len(values)
        cv2.imwriteanimation(str(path), film)
    source = open_source([str(path)])
    assert len(list(source)) == 3
    for number, (value, shot) in enumerate(zip(values, source, strict=True)):
        assert (shot.number, shot.name, shot.fault) == (number, str(number), "")
        assert np.abs(shot.pixels().astype(int) - value).max() <= 5  # GIF has a palette
    readings = tmp_path / "metadata.csv"
    readings.write_text("file_name\n")
    with pytest.raises(InputError, match="is a film, and a table of readings is for images"):
        open_source([str(path)], readings)


def test_a_damaged_film_has_shots_with_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "film.tif"
    cv2.imwritemulti(str(path), [np.full((64, 64), one, np.uint8) for one in (1, 2, 3)])
    data = bytearray(path.read_bytes())
    data[8:40] = bytes(32)  # pixels of the first image
    path.write_bytes(data)
    shots = list(open_source([str(path)]))
    assert all(shot.image is not None or "film.tif" in shot.fault for shot in shots)
    assert shots[-1].image is not None


def test_only_a_camera_can_be_set(tmp_path: Path) -> None:
    image = tmp_path / "a.png"
    image.write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    with pytest.raises(InputError, match=r"a\.png: is not a camera; size"):
        open_source([str(image)], controls=Controls(exposure=5.0))


def test_two_rows_of_one_image_are_refused(tmp_path: Path) -> None:
    image, readings = tmp_path / "a.png", tmp_path / "metadata.csv"
    image.write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    readings.write_text("file_name,motor_angle_deg\na.png,30\na.png,31\n")
    with pytest.raises(InputError, match=r"holds two rows for a\.png, allowed is one"):
        open_source([str(image)], readings)


def test_readings_are_found_by_the_images_they_belong_to(dataset: Path) -> None:
    shard = dataset / "observations" / "shard_00000"
    known = {frame.path.name: frame for frame in open_observations(dataset / "observations")}
    images = sorted(str(path) for path in shard.glob("*.png"))
    for shot in open_source(images, shard / "metadata.csv"):
        frame = known[Path(shot.name).name]
        assert (shot.readings, shot.push_id) == (frame.readings, frame.push_id)
        assert shot.readings.motor_angle is not None
    for shot in open_source(images):
        assert shot.readings.motor_angle is None
    other = next((dataset / "observations" / "rest").glob("*.png"))
    with pytest.raises(InputError, match=r"metadata\.csv: holds no row for rest_00\.png"):
        open_source([str(other)], shard / "metadata.csv")


def test_a_rig_and_its_images_may_be_in_other_formats(dataset: Path, tmp_path: Path) -> None:
    whole = open_observations(dataset / "observations")
    for folder, paths in (("calibration", whole.board_views), ("rest", whole.rest_images)):
        (tmp_path / folder).mkdir()
        for path, suffix in zip(paths, (".bmp", ".tif", *(".jpg",) * len(paths)), strict=False):
            cv2.imwrite(str(tmp_path / folder / path.with_suffix(suffix).name), read_grey(path))
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images" / "a.bmp"), read_grey(whole.frames[0].path))
    shutil.copy(whole.root / "rig.json", tmp_path)
    opened = open_observations(tmp_path)
    assert [one.stem for one in opened.board_views] == [one.stem for one in whole.board_views]
    assert [one.suffix for one in opened.rest_images[:2]] == [".bmp", ".tif"]
    assert np.array_equal(next(opened.read_rest_images()), next(whole.read_rest_images()))
    assert [frame.frame_id for frame in opened.frames] == ["a"]


def test_a_rig_needs_its_images(dataset: Path, tmp_path: Path) -> None:
    whole = open_observations(dataset / "observations")
    opened = open_rig_files(dataset / "observations" / "rig.json")
    assert (opened.board_views, opened.rest_images) == (whole.board_views, whole.rest_images)
    assert not opened.frames
    root = tmp_path / "rig"
    with pytest.raises(InputError, match=r"rig: cannot be read"):
        open_rig_files(root)
    root.mkdir()
    with pytest.raises(InputError, match=r"rig\.json: cannot be read"):
        open_rig_files(root)
    shutil.copy(whole.root / "rig.json", root)
    with pytest.raises(InputError, match=r"holds no calibration/view_\*\.png"):
        open_rig_files(root)
    shutil.copytree(whole.root / "calibration", root / "calibration")
    with pytest.raises(InputError, match=r"holds no rest/rest_\*\.png"):
        open_rig_files(root)
    (root / "rest").mkdir()
    (root / "rest" / "rest_00.png").write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    with pytest.raises(InputError, match=r"rest_00\.png: has 5 x 4 px, allowed is the size"):
        open_rig_files(root)
