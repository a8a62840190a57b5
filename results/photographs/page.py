"""The table, the page and the picture of the check of photographs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from results.photographs.folder import rig_name
from results.photographs.measure import Solved, record

HEADS: Final = (
    "photographs",
    "rigs",
    "photos",
    "answered, %",
    "force: median error, %",
    "force: RMSE, %",
    "force in 3 sigma, %",
    "force: sigma / RMSE",
    "place: median error, % of L",
    "place: RMSE, % of L",
    "place in 3 sigma, %",
    "place: sigma / RMSE",
)
# Parts of the photographs, each with a row of its own.
_PARTS: Final[Mapping[str, Callable[[Solved], bool]]] = {
    "all": lambda _one: True,
    "with marks of a ruler": lambda one: one.marks,
    "without marks": lambda one: not one.marks,
    "beam narrower than 10 px": lambda one: one.width_px < 10,
    "beam of 10 px and more": lambda one: one.width_px >= 10,
    "load in the inner 70 % of the beam": lambda one: one.s_c_mm < 0.7 * one.length_mm,
    "load nearer to the tip": lambda one: one.s_c_mm >= 0.7 * one.length_mm,
}
# Size of each photograph in the picture [px], and its columns.
_TILE_PX, _COLUMNS = (480, 360), 3
# Table of real photographs, by `results.photographs.skewers`.
SKEWERS: Final = Path(__file__).parent / "skewers.md"


def records(solved: Sequence[Solved]) -> dict[str, dict[str, Any]]:
    """Score all photographs, and parts of them."""
    parts = {name: [one for one in solved if part(one)] for name, part in _PARTS.items()}
    return {name: record(chosen) for name, chosen in parts.items() if chosen}


def lines(scored: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Format records by part as rows of a table; HEADS are the columns."""
    return [
        (
            name,
            str(one["rigs"]),
            str(one["photos"]),
            f"{one['answered_pct']:.1f}",
            *(
                f"{one[f'{quantity}_{key}']:.{digits}}"
                for quantity in ("force", "place")
                for key, digits in (
                    ("median_pct", "2g"),
                    ("rmse_pct", "2g"),
                    ("in_3_sigma_pct", "1f"),
                    ("sigma_over_rmse", "2f"),
                )
            ),
        )
        for name, one in scored.items()
    ]


def markdown(
    scored: Mapping[str, Mapping[str, Any]], solved: Sequence[Solved], command: str, picture: str
) -> str:
    """Write the page; `picture` is the name of the picture beside it."""
    table = [HEADS, tuple("---" if i == 0 else "---:" for i in range(len(HEADS))), *lines(scored)]
    rows = "\n".join(f"| {' | '.join(row)} |" for row in table)
    outcomes = sorted({one.outcome for one in solved})
    counts = ", ".join(f"{sum(o.outcome == name for o in solved)} {name}" for name in outcomes)
    return f"""# Rendered photographs of a beam with hung weights

A laboratory has a round beam of wood, carbon or aluminium, a clamp and a phone. It takes eight to
ten photographs of the beam, each from another pose: two at rest, the others with a weight that
hangs on a thread. One weight and its place are stated in `photos.json`; of the others nothing is.
There is no board. `python -m solver photos` fits all photographs of a rig at once, in a child
process that is given only a copy of the folder.

`{command}`

{rows}

Outcomes: {counts}.

- A value is *in 3 sigma* if its error is within three of its stated sigmas. *sigma / RMSE* is the
  median sigma over the RMSE. The place is the arc length from the clamp.
- Drawn for every rig: length 250 to 450 mm, diameter (2 to 40 px in the image), material,
  background, focal length of 0.75 to 1.1 image widths, k1 with a sigma of 0.015, taper (2 %), bow
  (0.3 % of L), clamp softness (0.01 L / EI), direction of gravity (0.5 degrees). For every
  photograph: tilt of the phone (2.5 degrees about either axis), roll (up to 5 degrees), distance,
  rotation of the clamp (0.4 degrees), place (0.4 to 0.97 L) and mass of the weight (2 to 9 % of L
  at the tip). Clamp, tip and marks are clicked on with 0.7 to 1.5 px.
- Stated with the sigmas that they are drawn with: length, taper and clamp softness, direction of
  gravity, angle of view; the known force to 0.2 % and its place to 1 mm. EI is stated to 20 % in
  every second rig, the focal length to 10 % in two of three rigs, and two to four marks of known
  position are in every photograph of half of the rigs.
- The images have 2 megapixels, shot noise, the curve of sRGB and JPEG of quality 85 to 95. They are
  rendered in colour, with shadows and light that is reflected once; the phone's own sharpening and
  noise reduction are not modelled.

One photograph of each rig:

![One photograph of each rig]({picture})

## Real photographs

Six photographs of a bamboo skewer of 7 in on the edge of a table, with batteries of listed mass
hung on it at marked places, from a class in mechanics; they are not part of this project. Length,
ticks, load places and the focal length of the phone are stated, EI, bow and crop are not, and no
photograph shows the skewer at rest. `python -m results.photographs.skewers FOLDER` traces them and
asks for the forces; one force is stated. The sigma of the true forces is 0.02 N, by rubber band and
pin. The three photographs of the first rows were used while the fit was written; the others were
solved when it was done, and the sigmas of points were changed once after that, for the rendered
photographs above.

{SKEWERS.read_text(encoding="utf-8").strip()}

Loads near the clamp bend the skewer by less than its bow, which no photograph shows: they are
`not identifiable`. A dashed line is drawn into 9V_2in, and the trace takes it for the beam's edge
near the tip: this bends the common bow, and the force of AA_7in is too large, most with three
photographs. With six photographs and no stated place the fit left out those with which it did not
converge, and answered no force.
"""


def picture(work: Path, rigs: int) -> bytes:
    """Tile one loaded photograph of each rig into a JPEG image."""
    tiles = []
    for number in range(rigs):
        image = cv2.imread(str(work / "rigs" / rig_name(number) / "load_1.jpg"))
        tiles.append(cv2.resize(np.asarray(image), _TILE_PX, interpolation=cv2.INTER_AREA))
    while len(tiles) % _COLUMNS:
        tiles.append(np.full_like(tiles[0], 255))
    rows = [np.hstack(tiles[i : i + _COLUMNS]) for i in range(0, len(tiles), _COLUMNS)]
    success, data = cv2.imencode(".jpg", np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert success
    return bytes(data)
