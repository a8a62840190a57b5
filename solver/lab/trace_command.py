"""The command `trace`: images or a video of a thin object in, its centreline in every image out."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence, Sized
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer
from rich.progress import track

from solver.instrument.errors import InputError, cell_text, printable
from solver.instrument.images import ALL_CHANNELS
from solver.lab.console import console
from solver.lab.overlay import OverlayWriter, check_overlay, draw_traced
from solver.lab.shots import Shot, Source
from solver.lab.sources import open_source
from solver.lab.table import Row, csv_text
from solver.lab.writing import prepare_output_path, write
from solver.tracing.beam_fit import Rejection, TracedBeam
from solver.tracing.traced import TRACE_CHANNELS
from solver.tracing.traced import trace as traced

COLUMNS: Final = (
    "image",
    "part",
    "u_px",
    "v_px",
    "sigma_px",
    "normal_u",
    "normal_v",
    "width_px",
    "shift_sigma_px",
    "message",
)
MEASURED: Final = "measured"
# Part of an image in which nothing was traced; the message says why.
NO_BEAM: Final = "no_beam"
# Images whose sentence is printed. Chosen: a screen.
_MAX_SENTENCES: Final = 20


class Traced(NamedTuple):
    """Beam that was traced in an image, or None and the reason."""

    image: str
    beam: TracedBeam | None
    message: str = ""


def trace(
    sources: Annotated[list[str], typer.Argument(help="images, or a video")],
    start: Annotated[
        str, typer.Option(help="pixel at which the beam begins in the first image: U,V")
    ],
    end: Annotated[str, typer.Option(help="pixel at which it ends: U,V")],
    out: Annotated[Path, typer.Option(help="CSV to write")] = Path("points.csv"),
    overlay: Annotated[
        Path | None,
        typer.Option(help="folder, .mp4 or .avi for the overlays, .png for a single one"),
    ] = None,
    channel: Annotated[
        str,
        typer.Option(help=f"channel read from colour images: {', '.join(TRACE_CHANNELS)}"),
    ] = ALL_CHANNELS,
) -> None:
    """Trace the centreline of a beam, wire or whisker in images or a video, without a rig.

    In several images, and in a video, the beam in each is the guess for the next.
    """
    marks = _mark("--start", start), _mark("--end", end)
    if channel not in TRACE_CHANNELS:
        raise InputError(f"--channel is '{channel}', allowed is one of {', '.join(TRACE_CHANNELS)}")
    source, read = open_source(sources, channel=channel), [Path(name) for name in sources]
    if source.live:
        raise InputError(f"{sources[0]}: is a camera, allowed are images or a video")
    prepare_output_path(out, read)
    check_overlay(overlay, source, read, out)
    results: list[Traced] = []
    beam: TracedBeam | None = None
    try:
        with ExitStack() as stack:
            writer = stack.enter_context(OverlayWriter(overlay, source.rate)) if overlay else None
            for shot in _with_progress(source):
                result = _traced(shot, marks, beam)
                results.append(result)
                beam = result.beam or beam
                if writer and shot.image is not None:
                    picture = draw_traced(shot.image, result.beam, (sentence(result), shot.name))
                    writer.write(picture, shot.number, shot.name)
    finally:  # also after Ctrl-C, and of a video that ends too early
        if beam is not None:
            write(out, csv_text([row for one in results for row in rows(one)], COLUMNS).encode())
            print("\n".join([*summary(results), f"written to {out}"]))
    if beam is None:
        raise InputError(f"{results[0].image}: {results[0].message}")


def _traced(
    shot: Shot, marks: tuple[tuple[float, float], ...], previous: TracedBeam | None
) -> Traced:
    """Trace the beam in one image; without a beam, the message says why."""
    try:
        image = shot.pixels()
        return Traced(shot.name, traced(image, marks[0], marks[1], previous=previous))
    except InputError as error:
        return Traced(shot.name, None, str(error).removeprefix(f"{shot.name}: "))


def _with_progress(source: Source) -> Iterable[Shot]:
    """Show a bar on a terminal."""
    total = len(source) if isinstance(source, Sized) else None
    hidden = not console.is_terminal
    return track(source, "tracing", total, console=console, transient=True, disable=hidden)


def _mark(option: str, text: str) -> tuple[float, float]:
    """Read a pixel from an option. Raises InputError."""
    try:
        u, v = map(float, text.split(","))
    except ValueError:
        u = v = math.nan
    if not (math.isfinite(u) and math.isfinite(v)):
        raise InputError(f"{option} is '{text}', allowed is a pixel U,V such as 120,85.5")
    return u, v


def rows(result: Traced) -> list[Row]:
    """Make the rows of an image: one per section, from start to end, or one that says why not."""
    beam = result.beam
    if beam is None:
        message = cell_text(result.message)
        return [
            {**dict.fromkeys(COLUMNS), "image": result.image, "part": NO_BEAM, "message": message}
        ]
    values = np.column_stack([beam.points, beam.sigmas, beam.normals, beam.widths])
    measured: list[Row] = [
        {
            "image": result.image,
            "part": MEASURED,
            **dict(zip(COLUMNS[2:8], numbers, strict=True)),
            "shift_sigma_px": beam.shift_sigma,
        }
        for numbers in values.tolist()
    ]
    rejected: list[Row] = [
        {"image": result.image, "part": str(reason), "u_px": u, "v_px": v}
        for reason, (u, v) in zip(beam.reasons, beam.rejected.tolist(), strict=True)
    ]
    along = np.vstack([beam.points, beam.rejected]) @ (beam.ends[1] - beam.ends[0])
    every = measured + rejected
    return [every[i] for i in np.argsort(along, kind="stable")]


def sentence(result: Traced) -> str:
    """Describe an image's beam in one line."""
    beam = result.beam
    if beam is None:
        return f"no beam: {result.message}"
    count = len(beam.points) + len(beam.reasons)
    parts = Counter(beam.reasons)
    left_out = "".join(
        f", {100 * parts[one] / count:.0f} % {one}" for one in Rejection if parts[one]
    )
    return (
        f"{len(beam.points)} points, sigma {np.median(beam.sigmas):.2g} px, together "
        f"{beam.shift_sigma:.2g} px; width {np.median(beam.widths):.3g} px; "
        f"{100 * len(beam.points) / count:.0f} % measured{left_out}"
    )


def summary(results: Sequence[Traced]) -> list[str]:
    """Describe all images in lines, the first of many, and how many have no beam."""
    lines = [f"{printable(one.image)}: {printable(sentence(one))}" for one in results]
    if len(lines) <= _MAX_SENTENCES:
        return lines
    found = sum(one.beam is not None for one in results)
    without = next((line for line, one in zip(lines, results, strict=True) if not one.beam), None)
    first = [f"the first without: {without}"] if without else []
    return [lines[0], lines[-1], f"traced in {found} of {len(results)} images", *first]
