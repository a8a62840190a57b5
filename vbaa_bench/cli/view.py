"""The command view: frames of a dataset as recording, animation or sheet; a frame of a scene."""

from collections.abc import Sequence
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from solver.instrument.errors import InputError
from vbaa_bench.cli.data import say_what_is_drawn_once
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import (
    AsJson,
    Modules,
    SceneOrDataset,
    Seed,
    Settings,
    Variant,
    parsed_range,
)
from vbaa_bench.report.console import (
    console,
    print_line,
    print_result,
    progress_bar,
    progress_bars,
)

if TYPE_CHECKING:
    from vbaa_bench.scene.load import SceneFile


class Format(StrEnum):
    """Format of a view, which is also the suffix of its file."""

    RRD = "rrd"
    MP4 = "mp4"
    GIF = "gif"
    PNG = "png"


def view(
    source: SceneOrDataset,
    out: Annotated[
        Path | None,
        typer.Option(
            help="file to write",
            show_default="view.* in the dataset's folder report/; SCENE_FRAME.png",
        ),
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
        str | None,
        typer.Option(
            help="frames, as 7 or 3:7 (3 to 6), in the order of the scene's pushes",
            show_default="0:120; of a scene 0",
        ),
    ] = None,
    push: Annotated[
        list[str] | None, typer.Option(help="push_id of the frames to show; repeatable")
    ] = None,
    draws: Annotated[
        int | None,
        typer.Option("--random", min=1, max=1000, help="of a scene: number of draws to render"),
    ] = None,
    seed: Seed = None,
    settings: Settings = None,
    _module: Modules = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Show frames of a dataset with truth and estimates, or render one frame of a scene.

    A dataset is shown as a recording for rerun, an animation or one picture, with the estimates in
    its folder predictions/. A recording needs the extra `view` of this package, and an MP4 the
    extra `video`. Of a scene, one frame is drawn with its true centreline and contact; with
    --random, many draws of a scene with random keys.
    """
    if source.is_file() or source.suffix == ".yaml":
        if push or (draws and frames):
            raise InputError(
                f"{source}: is a scene, so that --push is not allowed, nor --frames with --random"
            )
        if format_ not in (None, Format.PNG):
            raise InputError(f"{source}: is a scene, drawn as png: --format is {format_}")
        _formats(out, Format.PNG)
        with importing():
            from vbaa_bench.scene.load import load_scene

        file = load_scene(source, seed, settings or ())
        say_what_is_drawn_once(file)
        if draws:
            _draw_random(file, draws, out, variant, as_json)
        else:
            _draw_frame(file, _number(frames or "0"), out, variant, as_json)
        return
    if draws or settings or seed is not None or variant is not None:
        raise InputError(
            f"{source}: is not a scene, so that --random, --seed, --set and --variant are not "
            "allowed"
        )
    _show_frames(source, out, format_, _frames(frames or "0:120"), push or (), as_json)


def _draw_frame(
    file: "SceneFile", number: int, out: Path | None, variant: str | None, as_json: bool
) -> None:
    """Render one frame of a scene as a PNG, with the true centreline and contact drawn on it."""
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.api.frame import render_frame

    target = out or Path(f"{file.path.stem}_{number}.png")
    prepare_output_path(target)
    with console.status("rendering a frame"):
        frame = render_frame(file, number, variant=variant)
    write(target, frame.png())
    record = {"picture": str(target), "truth": dict(frame.truth)}
    print_result(record, f"{target}: {frame}", as_json)


def _draw_random(
    file: "SceneFile", draws: int, out: Path | None, variant: str | None, as_json: bool
) -> None:
    """Render many draws of a scene with random keys as one contact sheet."""
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.api.preview import preview

    target = out or Path(f"{file.path.stem}_random.png")
    prepare_output_path(target)
    with progress_bars() as bars:
        png = preview(file, draws, variant=variant, progress=progress_bar(bars, "draws"))
    write(target, png)
    print_result({"picture": str(target), "draws": draws}, str(target), as_json)


def _show_frames(
    dataset: Path,
    out: Path | None,
    format_: Format | None,
    frames: slice,
    pushes: Sequence[str],
    as_json: bool,
) -> None:
    """Write frames of a dataset as recording, animation or contact sheet."""
    with importing():
        from vbaa_bench.api.views import view as view_frames
        from vbaa_bench.scoring.results_layout import Results

    paths = {}
    with progress_bars() as bars:
        for kind in _formats(out, format_):
            made = view_frames(
                dataset,
                out or Results(dataset).report / f"view.{kind}",
                frames=frames,
                pushes=pushes,
                progress=progress_bar(bars, kind),
                remark=print_line,
            )
            paths[str(kind)] = str(made.path)
    print_result({"frames": made.frames, **paths}, "\n".join(paths.values()), as_json)


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


def _number(text: str) -> int:
    """Parse the number of one frame. Raises InputError."""
    if not text.isdecimal():
        raise InputError(f"--frames is {text}, allowed for a scene is the number of one frame")
    return int(text)


def _frames(text: str) -> slice:
    """Parse a number of a frame, or a range. Raises InputError."""
    chosen = parsed_range(text)
    if chosen is None:
        raise InputError(f"--frames is {text}, allowed is a number or a range such as 0:120")
    return chosen
