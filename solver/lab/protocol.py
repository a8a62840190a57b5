"""A set of real images with known loads: its folder, and what is missing or wrong in it.

FOLDER/
  rig.json, calibration/, rest/, ground/    as in solver/instrument/observation.py, with `gravity`
  ruler/ruler_*                             a ruler beside the beam
  images/*                                  one image per load; metadata.csv, if a motor turns
  known.csv                                 a row per image: see `read_known`

known.csv is not read by any method: it is what balance and ruler know.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple

from solver.instrument.csv_table import CsvRow, csv_rows
from solver.instrument.errors import InputError, quoted
from solver.instrument.hashes import digest, read_bytes
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import image_files, image_head
from solver.instrument.observation import Observations, frames_beside, open_rig_files
from solver.instrument.rig import Rig
from solver.instrument.units import MILLIMETRE
from solver.lab.findings import Finding

Load = Literal["push", "weight"]
LOADS: Final[tuple[Load, ...]] = ("push", "weight")
KNOWN: Final = "known.csv"
# Least numbers of images. Chosen: enough loads that a wrong sigma of 1.5 times shows.
MIN_LOADS: Final = 20
MIN_REST, MIN_GROUND, MIN_RULER, MIN_VIEWS = 2, 2, 1, 6
# Least number of places of each kind of load. Chosen: fewer do not show a taper or a soft clamp.
MIN_PLACES: Final = 4


class KnownLoad(NamedTuple):
    """What balance and ruler know of an image: distances [m] and masses [kg], with sigmas.

    `distance` is from the clamp to the thread along the beam, for a weight; to the object's contact
    along the clamp's axis, for a push. `mass` is that of the weight with its thread, or what a
    balance shows that carries the object of a push; None without a balance.
    """

    file_name: str
    load: Load
    distance: float
    distance_sigma: float
    mass: float | None
    mass_sigma: float


@dataclass(frozen=True)
class Protocol:
    """An opened set: the rig with images at rest, its loads, and the frames by file name."""

    observations: Observations
    known: tuple[KnownLoad, ...]
    frames: dict[str, ImageFrame]

    def digest(self) -> str:
        """Compute the digest of the files that belong to the set, whatever its folder is called.

        It is that of a list as `sha256sum` prints it. Raises InputError.
        """
        opened = self.observations
        tables = [opened.root / "rig.json", opened.root / KNOWN]
        if (readings := opened.root / "images" / "metadata.csv").is_file():
            tables.append(readings)
        images = [*opened.board_views, *opened.rest_images, *opened.ground_images]
        images += image_files(opened.root / "ruler", "ruler_") + image_files(opened.root / "images")
        named = {path.relative_to(opened.root).as_posix(): path for path in [*tables, *images]}
        lines = [f"{digest(read_bytes(path))}  {name}\n" for name, path in sorted(named.items())]
        return digest("".join(lines).encode())


def read_known(folder: Path) -> tuple[list[KnownLoad], list[Finding]]:
    """Read known.csv of a set: the rows that can be used, and what is wrong with the others.

    The columns are file_name (in images/), load (push or weight), distance_mm, distance_sigma_mm,
    mass_g and mass_sigma_g; the last two may be empty for a push. Raises InputError if the file
    cannot be read.
    """
    loads, wrong = list[KnownLoad](), list[Finding]()
    for row in csv_rows(folder / KNOWN):
        try:
            loads.append(_known_load(folder, row))
        except InputError as error:
            wrong.append(Finding("row_wrong", str(error)))
    return loads, wrong


def _known_load(folder: Path, row: CsvRow) -> KnownLoad:
    def positive(name: str) -> float:
        return row.quantity(name, "a number above 0", above=0.0)

    name, kind = row.cells.get("file_name", ""), row.cells.get("load", "")
    load = next((one for one in LOADS if one == kind), None)
    if load is None:
        row.refuse(f"load is {quoted(kind)}, allowed is one of {', '.join(LOADS)}")
    if not name or Path(name).name != name or not (folder / "images" / name).is_file():
        row.refuse(f"file_name is {quoted(name)}, allowed is a file in images/")
    weighed = load == "weight" or bool(row.cells.get("mass_g"))
    return KnownLoad(
        name,
        load,
        positive("distance_mm"),
        positive("distance_sigma_mm"),
        positive("mass_g") if weighed else None,
        positive("mass_sigma_g") if weighed else 0.0,
    )


def check_protocol(folder: Path) -> tuple[Protocol | None, list[Finding]]:
    """List what is missing or wrong in a set before anything is calibrated or solved.

    The set is None if rig.json, the images of board and beam at rest or images/metadata.csv cannot
    be read.
    """
    try:
        loads, wrong = read_known(folder)
    except InputError as error:
        loads, wrong = [], [Finding("unreadable", str(error))]
    try:
        observations = open_rig_files(folder)
        frames = frames_beside(observations.root, observations.rig.channel)
    except InputError as error:
        return None, [Finding("unreadable", str(error)), *wrong]
    protocol = Protocol(observations, tuple(loads), {one.path.name: one for one in frames})
    return protocol, [*_too_few(protocol), *_rig_wrong(observations.rig), *wrong, *_files(protocol)]


def _too_few(protocol: Protocol) -> Iterator[Finding]:
    observations, known = protocol.observations, protocol.known
    alone = len(observations.board_views) == 1 and not observations.rig.distortion_coefficients
    counts = {
        "calibration/view_*": (len(observations.board_views), 1 if alone else MIN_VIEWS),
        "rest/rest_*": (len(observations.rest_images), MIN_REST),
        "ground/ground_*": (len(observations.ground_images), MIN_GROUND),
        "ruler/ruler_*": (len(image_files(observations.root / "ruler", "ruler_")), MIN_RULER),
    }
    for load in LOADS:
        distances = [one.distance for one in known if one.load == load]
        counts[f"rows of {KNOWN} with load {load}"] = len(distances), MIN_LOADS
        places = len(set(distances))
        if distances and places < MIN_PLACES:
            yield Finding(
                "too_few_places",
                f"{places} different distance_mm with load {load}, needed are {MIN_PLACES}: taper "
                "and clamp show only in loads at several places",
            )
    for name, (count, least) in counts.items():
        if count < least:
            yield Finding("too_few", f"{count} {name}, needed are {least}")


def _rig_wrong(rig: Rig) -> Iterator[Finding]:
    if rig.gravity is None:
        yield Finding("no_gravity", "rig.json states no gravity, which the hung weights need")
    elif math.sin(rig.gravity.direction) * rig.deflects_towards <= 0:
        yield Finding(
            "gravity_inconsistent",
            f"gravity.direction_deg in rig.json points away from the side deflects_towards "
            f"{rig.deflects_towards}, to which the weights bend the beam",
        )


def _files(protocol: Protocol) -> Iterator[Finding]:
    """Check that images and rows are the same, and that no image is of another kind or a copy."""
    folder = protocol.observations.root / "images"
    rows = Counter(one.file_name for one in protocol.known)
    for name, count in rows.items():
        if count > 1:
            yield Finding("row_twice", f"{KNOWN} has {count} rows for {name}, allowed is one")
    present = image_files(folder)
    unlisted = [path.name for path in present if path.name not in rows]
    if unlisted and rows:
        names = ", ".join(unlisted[:3]) + (", ..." if len(unlisted) > 3 else "")
        yield Finding("no_row", f"{len(unlisted)} images have no usable row in {KNOWN}: {names}")
    expected = image_head(protocol.observations.rest_images[0])
    by_bytes: dict[bytes, str] = {}
    for path in present:
        try:
            head, content = image_head(path), read_bytes(path)
        except InputError as error:
            yield Finding("image_unusable", str(error))
            continue
        if head != expected:
            yield Finding(
                "image_differs",
                f"{path.name} has {head.width} x {head.height} px of {head.bits} bits, and the "
                f"images at rest {expected.width} x {expected.height} px of {expected.bits} bits",
            )
        if (first := by_bytes.setdefault(content, path.name)) != path.name:
            yield Finding("image_copied", f"{path.name} is a copy of {first}")
    length = protocol.observations.rig.beam.length
    for load in protocol.known:
        if load.distance > length:
            yield Finding(
                "beyond_tip",
                f"{load.file_name}: distance_mm is {load.distance / MILLIMETRE:g}, allowed is up "
                f"to the beam's length, {length / MILLIMETRE:g}",
            )
