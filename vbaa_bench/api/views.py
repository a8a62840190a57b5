"""Pictures of datasets and of results: recordings, animations, contact sheets, and the report."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from solver.instrument.errors import InputError
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.api.data import AnyDataset, dataset_folder
from vbaa_bench.report.report import report
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.viewer.animation import gif, mp4
from vbaa_bench.viewer.frames import open_frames
from vbaa_bench.viewer.recording import write_recording
from vbaa_bench.viewer.sheet import contact_sheet

_DRAWN = {".mp4": mp4, ".gif": gif, ".png": contact_sheet}
_RECORDING = ".rrd"
# Chosen: a recording of 10 MB, or a video of 40 s.
USUAL_FRAMES = slice(0, 120)


class View(NamedTuple):
    """A written file, and the number of frames that it shows."""

    path: Path
    frames: int


def view(
    data: AnyDataset,
    out: Path | str,
    *,
    frames: slice = USUAL_FRAMES,
    pushes: Sequence[str] = (),
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    remark: Callable[[str], None] = lambda _sentence: None,
) -> View:
    """Show frames of a dataset with truth and estimates, in a file whose suffix is the format.

    .rrd is a recording for the viewer rerun (extra `view`), .mp4 an animation (extra `video`), .gif
    too, and .png a contact sheet. `frames` counts in the order of the scene's pushes, or within
    those of `pushes` (push_id). `remark` is called with a sentence on what a recording lacks.
    Raises InputError.

    >>> vb.view(data, "runs/first.png", frames=slice(0, 2)).frames
    2
    """
    target = Path(out)
    suffix = target.suffix.lower()
    if suffix not in (_RECORDING, *_DRAWN):
        allowed = ", ".join(name.removeprefix(".") for name in (_RECORDING, *_DRAWN))
        raise InputError(
            f"{target}: ends in {suffix.removeprefix('.')!r}, allowed is one of {allowed}"
        )
    shown = open_frames(dataset_folder(data), frames, pushes)
    prepare_output_path(target)

    def on_frame(done: int) -> None:
        progress(done, len(shown))

    if suffix == _RECORDING:
        if sentence := write_recording(shown, target, on_frame):
            remark(sentence)
    else:
        write(target, _DRAWN[suffix](shown, on_frame))
    return View(target, len(shown))


def write_report(data: AnyDataset, *, baseline: Path | str | None = None) -> Path:
    """Write the HTML report of a scored dataset or collection; return the path of the page.

    With a baseline file the page shows what has changed since. Raises InputError.

    >>> vb.write_report(data).name
    'report.html'
    """
    return report(Results(dataset_folder(data)), None if baseline is None else Path(baseline))
