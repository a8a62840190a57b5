"""Solve real photographs of a skewer with hung batteries:  python -m results.photographs.skewers

The photographs are those of a class in mechanics, whose instructions list the masses. They are not
part of this project; FOLDER is where they were downloaded to. Their marks were set by hand.
"""

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from results.photographs.page import SKEWERS
from solver.lab.command_end import run_command
from solver.lab.writing import write
from solver.photographs.fit import Shown
from solver.photographs.photos_json import FILE, read_photos
from solver.photographs.solve import answer_photos
from solver.tracing.traced import photograph, traced_beam

app = typer.Typer()

_INCH_MM: Final = 25.4
_GRAVITY_M_S2: Final = 9.81
# Masses [g] of the batteries in the instructions, and of rubber band and pin with its sigma.
_BATTERIES_G: Final = {"AA": 24.0, "9V": 45.0, "D": 136.0}
_BAND_G, _BAND_SIGMA_G = 2.0, 2.0


class Skewer(NamedTuple):
    """Marks of one photograph [px], and the load's place [in] from the clamp.

    `ticks` are u, v and the arc length [in]. Where the tip is hidden, `tip` is the last place that
    is visible.
    """

    clamp: tuple[float, float]
    tip: tuple[float, float]
    hidden: bool
    size: tuple[int, int]
    ticks: tuple[tuple[float, float, float], ...]
    at_in: float

    def force_n(self, name: str) -> float:
        """Return the weight [N] of the battery that the photograph is named after."""
        grams = _BATTERIES_G[name.split("_", maxsplit=1)[0]] + _BAND_G
        return grams / 1e3 * _GRAVITY_M_S2


# The first three were used while the fit was written, the others only for the table.
DEVELOPMENT: Final = {
    "9V_7in": Skewer(
        (187, 296),
        (3395, 438),
        True,
        (3747, 1196),
        ((1218, 323, 2), (2181, 368, 4.125), (3423, 440, 7)),
        7,
    ),
    "AA_7in": Skewer(
        (245, 283),
        (3150, 343),
        True,
        (3671, 1159),
        ((1189, 293, 2), (2060, 312, 4.125), (3175, 344, 7)),
        7,
    ),
    "9V_2in": Skewer(
        (240, 430),
        (3475, 463),
        False,
        (3530, 1264),
        ((2188, 454, 4.125), (2813, 460, 5.5)),
        2,
    ),
}
HELD_OUT: Final = {
    "9V_4_125in": Skewer(
        (188, 363),
        (3162, 404),
        False,
        (3180, 1081),
        ((1089, 376, 2), (2525, 397.5, 5.5)),
        4.125,
    ),
    "9V_5_5in": Skewer(
        (253, 343),
        (3491, 458),
        False,
        (3548, 1189),
        ((1261, 369.5, 2), (2202, 404, 4.125)),
        5.5,
    ),
    "D_7in": Skewer(
        (314, 177),
        (3850, 677),
        True,
        (4032, 1160),
        ((1465, 259, 2), (2538, 418, 4.125), (3892, 687, 7)),
        7,
    ),
}


class Asked(NamedTuple):
    """Answer for a photograph whose force is asked: true, estimate and sigma [N], and outcome.

    `photographs` is how many were fitted together; the force of `known` was stated.
    """

    photographs: int
    known: str
    place: str
    file: str
    force_n: float
    estimate_n: float | None
    sigma_n: float | None
    outcome: str


def document(skewers: Mapping[str, Skewer], known: str, *, places: bool) -> dict[str, Any]:
    """Return photos.json: what was measured on the skewer, and what is known about a phone.

    The skewer is 7 in long, of bamboo, between a box and a table; its ticks are drawn with a pen.
    The focal length is that of the phone's data sheet (26 mm for the 35 mm format). Where the
    photographs were cropped is unknown: an angle of the view replaces the principal point.
    """
    photos = []
    for name, one in skewers.items():
        load: dict[str, Any] = {"kind": "weight"}
        if places or name == known:
            # The pin at the tip is 2 to 4 mm from it.
            load |= {"at_mm": min(one.at_in, 6.95) * _INCH_MM, "at_sigma_mm": 3.0}
        if name == known:
            sigma = _BAND_SIGMA_G / 1e3 * _GRAVITY_M_S2
            load |= {"force_n": one.force_n(name), "force_sigma_n": sigma}
        photos.append(
            {
                "file": f"{name}.jpg",
                "clamp_px": one.clamp,
                "tip_px": one.tip,
                "tip_hidden": one.hidden,
                "principal_point_px": [(side - 1) / 2 for side in one.size],
                "ticks": [
                    {"px": [u, v], "at_mm": at * _INCH_MM, "at_sigma_mm": 1.5}
                    for u, v, at in one.ticks
                ],
                "load": load,
            }
        )
    return {
        "beam": {"length_mm": 179.0, "length_sigma_mm": 2.0},
        "beam_shape": {
            "taper_sigma": 0.03,
            "clamp_softness_sigma": 0.05,
            "clamp_shift_sigma_mm": 2.0,
        },
        "camera": {
            "focal_length_px": 3040,
            "focal_length_sigma_px": 60,
            "view_sigma_deg": 10,
        },
        "mark_sigma_px": 2.0,
        "down_deg": -90,
        "down_sigma_deg": 3,
        "photos": photos,
    }


def solved(folder: Path) -> list[Asked]:
    """Trace the photographs of a folder, and fit them with several statements."""
    every: list[Asked] = []
    shown: dict[str, Shown] = {}
    for skewers, known, places in _CASES:
        with tempfile.TemporaryDirectory() as scratch:
            (Path(scratch) / FILE).write_text(json.dumps(document(skewers, known, places=places)))
            photos = read_photos(Path(scratch))
        for photo in photos.photographs:
            if photo.path.name not in shown:
                image = photograph(folder / photo.path.name, photos.channel)
                beam = traced_beam(image, photo.clamp, photo.tip)
                shown[photo.path.name] = Shown(beam, skewers[photo.path.stem].size)
        answer = answer_photos(photos, [shown[one.path.name] for one in photos.photographs], {})
        for name, one in zip(skewers, answer.answers, strict=True):
            force = one.values.get("force_n")
            every.append(
                Asked(
                    photographs=len(skewers),
                    known=known,
                    place="stated" if places else "asked",
                    file=name,
                    force_n=skewers[name].force_n(name),
                    estimate_n=force.value if force else None,
                    sigma_n=force.sigma if force else None,
                    outcome=str(one.outcome),
                )
            )
    return every


_CASES: Final = (
    (DEVELOPMENT, "9V_7in", True),
    (DEVELOPMENT, "9V_7in", False),
    (DEVELOPMENT | HELD_OUT, "9V_7in", True),
    (DEVELOPMENT | HELD_OUT, "D_7in", True),
)
_HEADS: Final = (
    "photographs",
    "stated force",
    "places",
    "asked in",
    "force, N",
    "answer, N",
    "sigma, N",
    "outcome",
)


def table(every: Sequence[Asked]) -> str:
    """Write the answers as a table."""
    lines = [_HEADS, tuple("---:" if head.endswith(", N") else "---" for head in _HEADS)]
    for one in every:
        if one.file == one.known:
            continue
        values = [f"{v:.2f}" if v is not None else "" for v in (one.estimate_n, one.sigma_n)]
        force = f"{one.force_n:.2f}"
        lines.append(
            (str(one.photographs), one.known, one.place, one.file, force, *values, one.outcome)
        )
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


@app.command()
def check_skewers(
    folder: Annotated[Path, typer.Argument(help="folder of the downloaded photographs")],
    out: Annotated[Path, typer.Option(help="file for the table")] = SKEWERS,
) -> None:
    """Trace and fit photographs of a skewer with hung batteries; write a table of the forces.

    The next `python -m results.photographs` includes the table in README.md.
    """
    text = table(solved(folder))
    write(out, text.encode())
    print(text)


if __name__ == "__main__":
    run_command(app)
