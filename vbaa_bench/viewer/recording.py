"""Recording of frames for the viewer rerun: geometry in space, images, and values over time.

Its blueprint lays them out: space, image, values over time, ellipses, and a table.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.files import move_into_place
from solver.instrument.hashes import digest
from solver.instrument.units import MILLIMETRE
from vbaa_bench.report import palette
from vbaa_bench.report.gallery import display
from vbaa_bench.viewer.bodies import Bodies
from vbaa_bench.viewer.ellipses import HALF, estimated_contact
from vbaa_bench.viewer.frames import ViewedDataset, ViewedFrame
from vbaa_bench.viewer.log import Log, present
from vbaa_bench.viewer.plots import Plots, Series, estimated_series
from vbaa_bench.viewer.space import Space

# From OpenCV's pixels, whose centres have integer coordinates, to those of rerun.
_HALF_PIXEL: Final = np.array([0.5, 0.5])
# Entity of the camera and its image.
_IMAGE: Final = "space/camera"
# Direction from which space is shown. Chosen: from the side of the object, and from above.
_FROM: Final = np.array([0.25, -1.0, 0.3])
# Chosen: the steps of a push can be followed.
_FRAMES_PER_SECOND: Final = 4.0


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
        stream.save(aside, default_blueprint=_blueprint(data, estimated_series(data)))
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
    log.write(f"{_IMAGE}/image", image)
    log.lines(f"{_IMAGE}/beam", [overlay.centreline + _HALF_PIXEL], palette.TRUTH, 0.7)
    contact = None if overlay.contact is None else overlay.contact + _HALF_PIXEL
    log.points(f"{_IMAGE}/contact", present(contact), palette.TRUTH, 5.0, "true contact")
    for method, colour in colours.items():
        position = overlay.estimates.get(method)
        shifted = None if position is None else position + _HALF_PIXEL
        log.points(f"{_IMAGE}/estimates/{method}", present(shifted), colour, 3.0, method)
        estimate = estimated_contact(frame, method)
        outline = None if estimate is None else estimate.ellipse
        strips = [] if outline is None else [frame.truth.camera.project(outline) + _HALF_PIXEL]
        log.lines(f"{_IMAGE}/estimates/{method}/ellipse", strips, colour)


def _blueprint(data: ViewedDataset, series: Sequence[Series]) -> Any:
    """Lay out the views of a recording; each of `series` has a plot over time."""
    import rerun.blueprint as rrb  # an extra, which takes a second to import

    camera, rim = data.truth.camera, 1.12 * HALF
    # A telecentric camera has no pyramid in which its image could be shown.
    contents = "/space/3d/**" if camera.telecentric else "/space/**"
    space = rrb.Spatial3DView(
        origin="/space", contents=contents, name="space [mm]", eye_controls=_eye(rrb, data)
    )
    image_range = rrb.VisualBounds2D(x_range=[0, camera.width], y_range=[0, camera.height])
    image = rrb.Spatial2DView(origin=f"/{_IMAGE}", name="image", visual_bounds=image_range)
    # The ellipses are in the colours of the first plot's legend.
    plots = [
        rrb.TimeSeriesView(
            origin=f"/{one.name}",
            name=one.heading,
            plot_legend=rrb.PlotLegend(visible=number == 0, corner=rrb.Corner2D.RightBottom),
        )
        for number, one in enumerate(series)
    ]
    errors = rrb.Spatial2DView(
        origin="/errors",
        name="errors of x_c and force, 95 % ellipses",
        visual_bounds=rrb.VisualBounds2D(x_range=[-rim, rim], y_range=[-rim, rim]),
    )
    table = rrb.TextDocumentView(origin="/table", name="truth and estimates")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(space, image, row_shares=[3, 2]),
            rrb.Vertical(*plots, row_shares=[3, *[2] * (len(plots) - 1)]),
            rrb.Vertical(errors, table, row_shares=[3, 2]),
            column_shares=[4, 3, 3],
        ),
        rrb.TimePanel(timeline="frame", state="collapsed", fps=_FRAMES_PER_SECOND),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _eye(rrb: Any, data: ViewedDataset) -> Any:
    """Look at the middle between the beam and the camera, from where both are in view."""
    length, camera = data.truth.manifest["true_rig"]["beam_length_mm"], data.truth.camera
    beam = np.array([length / 2, 0.0, 0.0])
    lens = beam if camera.telecentric else camera.viewpoint[:3] / MILLIMETRE
    target = (beam + lens) / 2
    distance = max(0.9 * (float(np.linalg.norm(lens - beam)) + length / 2), 1.1 * length)
    position = target + distance * _FROM / np.linalg.norm(_FROM)
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))


def _rerun() -> Any:
    try:
        import rerun  # an extra, which takes a second to import
    except ImportError as error:
        raise InputError(
            "a recording for rerun needs the extra 'vbaa-bench[view]' (rerun-sdk); --format mp4, "
            "gif and png do not"
        ) from error
    return rerun
