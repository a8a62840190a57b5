"""Recording of frames for the viewer rerun: geometry in space, images, and values over time."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.files import move_into_place
from solver.instrument.hashes import digest
from vbaa_bench.report import palette
from vbaa_bench.report.gallery import display
from vbaa_bench.viewer.blueprint import IMAGE, blueprint
from vbaa_bench.viewer.bodies import Bodies
from vbaa_bench.viewer.contact import estimated_contact
from vbaa_bench.viewer.frames import ViewedDataset, ViewedFrame
from vbaa_bench.viewer.log import Log, present
from vbaa_bench.viewer.plots import Plots, estimated_series
from vbaa_bench.viewer.space import Space

# From OpenCV's pixels, whose centres have integer coordinates, to those of rerun.
_HALF_PIXEL: Final = np.array([0.5, 0.5])


def write_recording(
    data: ViewedDataset,
    out: Path,
    progress: Callable[[int], None] = lambda _done: None,
) -> str:
    """Write frames as a recording (.rrd), which the viewer rerun opens.

    Its timelines are `frame`, frames in the order of the scene's pushes, and `push`. Return a
    remark on what is not shown, or an empty text. Raises InputError without rerun, or if `out`
    cannot be written.
    """
    rr = _rerun()
    bodies = Bodies(data.truth, data.trials)
    colours = {name: style.dark for name, style in palette.styles(list(data.predictions)).items()}
    aside = out.with_name(f".{out.name}.part")
    # Recordings of one file have one name, so that the viewer replaces an earlier one.
    stream = rr.RecordingStream("vbaa-bench", recording_id=digest(str(out.resolve()).encode()))
    log = Log(rr, stream)
    space, plots = Space(log, data, bodies), Plots(log, data, colours)
    try:
        stream.save(aside, default_blueprint=blueprint(data, estimated_series(data)))
        space.fixed()
        plots.fixed()
        for done, frame in enumerate(data):
            stream.set_time("frame", sequence=frame.number)
            stream.set_time("push", sequence=frame.push)
            space.frame(frame, colours)
            _write_image(log, frame, colours)
            plots.frame(frame)
            progress(done + 1)
        stream.flush()
        stream.disconnect()
        move_into_place(aside, out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from error
    finally:
        stream.disconnect()
        aside.unlink(missing_ok=True)
    return f"bodies are not shown: {bodies.reason}" if bodies.reason else ""


def _write_image(log: Log, frame: ViewedFrame, colours: dict[str, str]) -> None:
    """Write the image of a frame, brightened for display, and what is drawn on it."""
    overlay = frame.overlay
    success, png = cv2.imencode(".png", display(overlay.image))
    assert success
    image = log.rr.EncodedImage(contents=bytes(png), media_type="image/png")
    log.write(f"{IMAGE}/image", image)
    log.lines(f"{IMAGE}/beam", [overlay.centreline + _HALF_PIXEL], palette.TRUTH, 0.7)
    contact = None if overlay.contact is None else overlay.contact + _HALF_PIXEL
    log.points(f"{IMAGE}/contact", present(contact), palette.TRUTH, 5.0, "true contact")
    for method, colour in colours.items():
        position = overlay.estimates.get(method)
        shifted = None if position is None else position + _HALF_PIXEL
        log.points(f"{IMAGE}/estimates/{method}", present(shifted), colour, 3.0, method)
        estimate = estimated_contact(frame, method)
        outline = None if estimate is None else estimate.ellipse
        strips = [] if outline is None else [frame.truth.camera.project(outline) + _HALF_PIXEL]
        log.lines(f"{IMAGE}/estimates/{method}/ellipse", strips, colour)


def _rerun() -> Any:
    try:
        import rerun  # an extra, which takes a second to import
    except ImportError as error:
        raise InputError(
            "a recording for rerun needs the extra '.[view]' (rerun-sdk); --format mp4, gif and "
            "png do not"
        ) from error
    return rerun
