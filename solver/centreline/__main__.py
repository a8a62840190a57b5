"""`python -m solver.centreline photo.png --overlay lines.png`: the long thin lines of a photograph.

No rig, no rest image, nothing to be set: see `tracing.py`.
"""

import sys
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from rich.console import Console

from solver.centreline.tracing import Line, trace
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.images import read_grey
from solver.lab.drawing import Picture, enlarged, mark
from solver.lab.writing import write

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, no_args_is_help=True)

ENLARGED = 4


@app.command()
def run(
    photo: Annotated[Path, typer.Argument(help="an image, gray or colour, of 8 or 16 bits")],
    overlay: Annotated[Path | None, typer.Option(help="PNG to write: the lines drawn")] = None,
    out: Annotated[Path | None, typer.Option(help="CSV to write", show_default="to stdout")] = None,
) -> None:
    """Follow every long thin line in a photograph: points [px] with their sigma."""
    image = read_grey(photo)
    lines = trace(image)
    text = csv(lines)
    if out is None:
        sys.stdout.write(text)
    else:
        write(out, text.encode())
    if overlay is not None:
        _, data = cv2.imencode(".png", draw(image, lines), [cv2.IMWRITE_PNG_COMPRESSION, 9])
        write(overlay, bytes(data))
    said = Console(stderr=True, highlight=False, soft_wrap=True)
    for number, line in enumerate(lines):
        kind = "bright" if line.polarity > 0 else "dark"
        seen = line.centreline
        said.print(
            f"line {number}: {kind}, {len(seen.points)} points, {len(seen.rejected)} places "
            f"rejected, sigma {np.median(seen.sigma):.3f} px, "
            f"{line.roughness:.3f} px about a smooth curve"
        )
    if not lines:
        said.print("no long thin line")


def csv(lines: list[Line]) -> str:
    """A row a point: its line, u and v [px], the direction in which it was measured, its sigma."""
    rows = ["line,u_px,v_px,along_u,along_v,sigma_px"]
    for number, line in enumerate(lines):
        seen = line.centreline
        rows += [
            f"{number},{u:.4f},{v:.4f},{a:g},{b:g},{s:.4f}"
            for (u, v), (a, b), s in zip(seen.points, seen.directions, seen.sigma, strict=True)
        ]
    return "\n".join(rows) + "\n"


def draw(image: Grey, lines: list[Line]) -> Picture:
    """The image enlarged (height, width, 3), BGR: points green, rejected places by their flags."""
    picture = enlarged(image, ENLARGED)
    for line in lines:
        mark(picture, line.centreline, ENLARGED)
    return picture


def main() -> None:
    """Run the command; a mistake in the input is one sentence and exit status 2."""
    try:
        app()
    except InputError as error:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"error: {error}", markup=False)
        sys.exit(2)


if __name__ == "__main__":
    main()
