"""The command view: a recording for the viewer rerun, an animation, or a contact sheet."""

from enum import StrEnum
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from solver.instrument.errors import InputError
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, DatasetPath
from vbaa_bench.report.console import console, print_result, progress_bars

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Format(StrEnum):
    """Format of a view, which is also the suffix of its file."""

    RRD = "rrd"
    MP4 = "mp4"
    GIF = "gif"
    PNG = "png"


def view(
    dataset: DatasetPath,
    out: Annotated[
        Path | None,
        typer.Option(help="file to write", show_default="view.* in the dataset's folder report/"),
    ] = None,
    format_: Annotated[
        Format | None,
        typer.Option(
            "--format",
            help="rrd: for the viewer rerun; mp4 or gif: animation; png: contact sheet",
            show_default="that of --out; else the first for which an extra is installed, and png",
        ),
    ] = None,
    # The default is chosen: a recording of 10 MB, or a video of 40 s.
    frames: Annotated[
        str, typer.Option(help="frames, as 7 or 3:7 (3 to 6), in the order of the scene's pushes")
    ] = "0:120",
    push: Annotated[
        list[str] | None, typer.Option(help="push_id of the frames to show; repeatable")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show frames with truth and estimates: as a recording for rerun, an animation or one picture.

    A recording needs the extra `view` of this package, and an MP4 the extra `video`. The estimates
    are those in the dataset's folder predictions/.
    """
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.scoring.layout import Results
        from vbaa_bench.viewer.animation import gif, mp4
        from vbaa_bench.viewer.frames import open_frames
        from vbaa_bench.viewer.recording import write_recording
        from vbaa_bench.viewer.sheet import contact_sheet

    draw = {Format.MP4: mp4, Format.GIF: gif, Format.PNG: contact_sheet}
    targets = {
        kind: out or Results(dataset).report / f"view.{kind}" for kind in _formats(out, format_)
    }
    data = open_frames(dataset, _range(frames), push or ())
    with progress_bars() as bars:
        for kind, target in targets.items():
            prepare_output_path(target)
            progress = partial(_report, bars, bars.add_task(kind, total=len(data)))
            if kind == Format.RRD:
                remark = write_recording(data, target, progress)
                console.print(remark, markup=False, end="\n" if remark else "")
            else:
                write(target, draw[kind](data, progress))
    paths = {str(kind): str(target) for kind, target in targets.items()}
    print_result({"frames": len(data), **paths}, "\n".join(paths.values()), as_json)


def _report(bars: "Progress", task: "TaskID", done: int) -> None:
    bars.update(task, completed=done)


def _formats(out: Path | None, chosen: Format | None) -> list[Format]:
    """Choose the formats to write. Raises InputError for an unknown suffix of `out`."""
    allowed = ", ".join(Format)
    suffix = "" if out is None else out.suffix.removeprefix(".").lower()
    if out is not None and (suffix not in set(Format) if chosen is None else suffix != chosen):
        raise InputError(f"{out}: ends in {suffix!r}, allowed is {chosen or f'one of {allowed}'}")
    if suffix:
        return [Format(suffix)]
    if chosen is not None:
        return [chosen]
    installed = {Format.RRD: "rerun", Format.MP4: "av"}
    first = next((one for one, module in installed.items() if find_spec(module)), Format.GIF)
    return [first, Format.PNG]


def _range(text: str) -> slice:
    """Parse a number of a frame, or a range. Raises InputError."""
    first, colon, last = text.partition(":")
    if not all(part == "" or part.isdecimal() for part in (first, last)) or text in ("", ":"):
        raise InputError(f"--frames is {text}, allowed is a number or a range such as 0:120")
    start = int(first or 0)
    if not colon:
        return slice(start, start + 1)
    return slice(start, int(last) if last else None)
