"""Frames as an animation: MP4 with PyAV, or GIF."""

import io
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any, Final

import cv2
import numpy as np

from solver.instrument.errors import InputError
from vbaa_bench.report.gallery import colours_of
from vbaa_bench.viewer.drawn_frame import draw_frame
from vbaa_bench.viewer.ellipses import ellipse_plot
from vbaa_bench.viewer.frames import ViewedDataset

Progress = Callable[[int], None]
# Chosen: the steps of a push can be followed.
FRAMES_PER_SECOND: Final = 3
# Frames of a GIF are kept in memory, 1.5 MB each, and a frame takes 200 kB of the file.
MAX_GIF_FRAMES: Final = 300
_GIF_WIDTH: Final = 900
_CRF: Final = 20  # of x264; 18 is visually lossless, 23 the usual default


def mp4(data: ViewedDataset, progress: Progress) -> bytes:
    """Encode frames as an H.264 video. Raises InputError without PyAV."""
    av = _av()
    content = io.BytesIO()
    with av.open(content, "w", format="mp4") as container:
        stream = container.add_stream("libx264", Fraction(FRAMES_PER_SECOND), {"crf": str(_CRF)})
        stream.pix_fmt = "yuv420p"
        for number, picture in enumerate(_pictures(data, progress)):
            part = _even(picture)
            if number == 0:
                stream.height, stream.width = part.shape[:2]
            frame = av.VideoFrame.from_ndarray(part, "bgr24")
            frame.pts, frame.time_base = number, Fraction(1, FRAMES_PER_SECOND)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return content.getvalue()


def gif(data: ViewedDataset, progress: Progress) -> bytes:
    """Encode frames as a GIF that repeats. Raises InputError for too many frames."""
    if len(data) > MAX_GIF_FRAMES:
        raise InputError(
            f"{len(data)} frames are selected, allowed are {MAX_GIF_FRAMES} in a GIF; a video "
            "(--format mp4, extra 'vbaa-bench[video]') may have more"
        )
    animation = cv2.Animation()
    pictures = [_reduced(picture) for picture in _pictures(data, progress)]
    animation.frames = pictures
    animation.durations = [round(1000 / FRAMES_PER_SECOND)] * len(pictures)
    success, content = cv2.imencodeanimation(".gif", animation)
    assert success
    return bytes(content)


def _av() -> Any:
    try:
        import av  # an extra
    except ImportError as error:
        raise InputError("a video needs the extra 'vbaa-bench[video]' (PyAV)") from error
    return av


def _pictures(data: ViewedDataset, progress: Progress) -> Iterable[np.ndarray]:
    colours, plot = colours_of(list(data.predictions)), ellipse_plot(data.predictions)
    for number, frame in enumerate(data):
        yield draw_frame(frame, colours, plot)
        progress(number + 1)


def _even(picture: np.ndarray) -> np.ndarray:
    """Cut a picture (height, width, 3) to even sizes, which video codecs need."""
    height, width = picture.shape[:2]
    return np.ascontiguousarray(picture[: height - height % 2, : width - width % 2])


def _reduced(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    size = (_GIF_WIDTH, round(height * _GIF_WIDTH / width))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
