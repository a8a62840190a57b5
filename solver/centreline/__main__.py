"""`python -m solver.centreline photo.png --overlay lines.png`: the long thin lines of a photograph.

No rig, no rest image, nothing to be set: see `tracing.py`.
"""

import sys
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
from rich.console import Console

from solver.centreline import Flag
from solver.centreline.tracing import Line, trace
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes
from solver.instrument.images import eight_bit
from solver.shots import read_image

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, no_args_is_help=True)

# Blue, green, red.
MEASURED = (80, 220, 80)
REJECTED = {
    Flag.HIDDEN: (255, 140, 60),
    Flag.SATURATED: (60, 220, 240),
    Flag.FOREIGN: (220, 80, 220),
}
ENLARGED = 4


@app.command()
def run(
    photo: Annotated[Path, typer.Argument(help="an image, gray or colour, of 8 or 16 bits")],
    overlay: Annotated[Path | None, typer.Option(help="PNG to write: the lines drawn")] = None,
    out: Annotated[Path | None, typer.Option(help="CSV to write [default: to stdout]")] = None,
) -> None:
    """Follow every long thin line in a photograph: points [px] with their sigma."""
    image = read_image(photo)
    lines = trace(image)
    text = csv(lines)
    if out is None:
        sys.stdout.write(text)
    else:
        _write(out, text.encode())
    if overlay is not None:
        _, data = cv2.imencode(".png", draw(image, lines), [cv2.IMWRITE_PNG_COMPRESSION, 9])
        _write(overlay, bytes(data))
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


def draw(image: Grey, lines: list[Line]) -> Any:
    """The image enlarged (height, width, 3), BGR: points green, rejected places by their flags."""
    large = eight_bit(image).repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    picture = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    for line in lines:
        seen = line.centreline
        for flag, colour in REJECTED.items():
            _dots(picture, seen.rejected[seen.flags == flag], colour)
        _dots(picture, seen.points, MEASURED)
    return picture


def _dots(picture: Any, points: Floats, colour: tuple[int, int, int]) -> None:
    sixteenths = np.rint(((points + 0.5) * ENLARGED - 0.5) * 16).astype(int)
    for u, v in sixteenths:
        cv2.circle(picture, (int(u), int(v)), 16, colour, cv2.FILLED, cv2.LINE_AA, 4)


def _write(path: Path, data: bytes) -> None:
    try:
        write_bytes(path, data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error


def main() -> None:
    """Run the command; a mistake in the input is one sentence and exit status 2."""
    try:
        app()
    except InputError as error:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"error: {error}", markup=False)
        sys.exit(2)


if __name__ == "__main__":
    main()
