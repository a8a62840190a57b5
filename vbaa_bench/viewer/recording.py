"""Recording of frames for the viewer rerun: geometry in space, images, and values over time."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from solver.instrument.errors import InputError
from solver.instrument.files import move_into_place
from solver.instrument.hashes import digest
from vbaa_bench.report import palette
from vbaa_bench.viewer.blueprint import blueprint
from vbaa_bench.viewer.bodies import Bodies
from vbaa_bench.viewer.frames import ViewedDataset
from vbaa_bench.viewer.log import Log
from vbaa_bench.viewer.picture import write_picture
from vbaa_bench.viewer.plots import Plots, estimated_series
from vbaa_bench.viewer.space import Space


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
            write_picture(log, frame, colours)
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


def _rerun() -> Any:
    try:
        import rerun  # an extra, which takes a second to import
    except ImportError as error:
        raise InputError(
            "a recording for rerun needs the extra '.[view]' (rerun-sdk); --format mp4, gif and "
            "png do not"
        ) from error
    return rerun
