"""Perturbations by video: encode images, and decode them as the solver reads videos."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Grey
from solver.lab.sources import open_source
from vbaa_bench.benchmarks.stress.recording import (
    Images,
    NotApplicableError,
    Perturbation,
    Recording,
)

FRAME_RATE: Final = 30
# For reproducible bytes: the result of x264's vector code depends on earlier contents of memory,
# and that of its threads on their number.
_DETERMINISTIC: Final = "asm=0:threads=1"
# Encodes images (height, width), of even sizes, into a file.
Encode = Callable[[Sequence[Grey], Path], None]


def h264(crf: int, rest_from_video: bool) -> Perturbation:
    """Encode the frames as one H.264 video; rest images come first, or stay unchanged.

    `crf` is x264's constant rate factor: 18 is visually lossless, 23 is the usual default.
    """
    return _by_video(lambda images, path: _encode_h264(images, path, crf), ".mp4", rest_from_video)


def mjpg(quality: int) -> Perturbation:
    """Encode rest images and frames as one video of JPEG images, as webcams send it."""
    return _by_video(lambda images, path: _encode_mjpg(images, path, quality), ".avi", True)


def _by_video(encode: Encode, suffix: str, rest_from_video: bool) -> Perturbation:
    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        rest_count = len(recording.rests) if rest_from_video else 0
        images = encode_and_decode(encode, suffix, recording.rests[:rest_count] + recording.frames)
        rests = images[:rest_count] or recording.rests
        return replace(recording, rests=rests, frames=images[rest_count:])

    return perturb


def encode_and_decode(encode: Encode, suffix: str, images: Images) -> Images:
    """Encode images as a video and read it as the solver does.

    Codecs need even sizes: the last column or row is repeated, and removed again.
    """
    height, width = images[0].shape
    padded = [np.pad(image, ((0, height % 2), (0, width % 2)), mode="edge") for image in images]
    with tempfile.TemporaryDirectory(prefix="vbaa-stress-") as folder:
        path = Path(folder) / f"video{suffix}"
        encode(padded, path)
        decoded = tuple(shot.pixels()[:height, :width] for shot in open_source([str(path)]))
    if len(decoded) != len(images):
        raise RuntimeError(f"the video has {len(decoded)} of {len(images)} images")
    return decoded


def _encode_h264(images: Sequence[Grey], path: Path, crf: int) -> None:
    try:
        import av
    except ImportError as error:
        raise NotApplicableError("needs the extra 'video'") from error
    height, width = images[0].shape
    with av.open(path, "w") as container:
        options = {"crf": str(crf), "x264-params": _DETERMINISTIC}
        stream = container.add_stream("libx264", Fraction(FRAME_RATE), options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for number, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(_luma(image), "yuv420p")
            frame.pts, frame.time_base = number, Fraction(1, FRAME_RATE)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _luma(image: Grey) -> npt.NDArray[np.uint8]:
    """Make planes (3/2 height, width) of 4:2:0 video: luma from 16 to 235, and no colour.

    FFmpeg's own conversion of gray values is up to one level too dark.
    """
    height, width = image.shape
    planes = np.full((height * 3 // 2, width), 128, np.uint8)
    planes[:height] = np.rint(16 + image * (219 / 255))
    return planes


def _encode_mjpg(images: Sequence[Grey], path: Path, quality: int) -> None:
    height, width = images[0].shape
    code = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, code, FRAME_RATE, (width, height))
    if not writer.isOpened():
        raise NotApplicableError("OpenCV cannot write MJPG")
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, quality)
    for image in images:
        writer.write(np.repeat(image[:, :, None], 3, axis=2))
    writer.release()
