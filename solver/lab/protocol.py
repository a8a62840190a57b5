"""A set of real images with known loads: what is missing of it, and how a method answers it.

FOLDER/
  rig.json, calibration/, rest/, ground/    as in solver/instrument/observation.py, with `gravity`
  ruler/ruler_*                             a ruler beside the beam
  images/*                                  one image per load; metadata.csv, if a motor turns
  known.csv                                 a row per image: see `read_known`

known.csv is not read by any method: it is what balance and ruler know.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.instrument.csv_table import CsvRow, csv_rows
from solver.instrument.errors import InputError, quoted
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.hashes import read_bytes
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import image_files, image_head
from solver.instrument.observation import Observations, frames_beside, open_rig
from solver.instrument.rig import Rig
from solver.instrument.units import GRAM, MILLIMETRE
from solver.lab.findings import Finding
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from solver.tracker import PushTracker

Load = Literal["push", "weight"]
LOADS: Final[tuple[Load, ...]] = ("push", "weight")
KNOWN: Final = "known.csv"
# Least numbers of images. Chosen: enough loads that a wrong sigma of 1.5 times shows.
MIN_LOADS: Final = 20
MIN_REST, MIN_GROUND, MIN_RULER, MIN_VIEWS = 2, 2, 1, 6
# Least number of places of each kind of load. Chosen: fewer do not show a taper or a soft clamp.
MIN_PLACES: Final = 4
# Mean gravity [m/s^2] and its sigma on the ground. Derived: 9.780 at the equator, 9.832 at a pole,
# evenly distributed between them.
GRAVITY, GRAVITY_SIGMA = 9.806, 0.015
# Deviations above this number of combined sigmas are named as mistakes of a row. Chosen: a decimal
# point or another row is far above, and noise exceeds it once in two million values.
MISTAKE: Final = 5.0


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


class Comparison(NamedTuple):
    """A quantity of an image as it is known and as it is estimated, in the unit of its name."""

    file_name: str
    load: Load
    quantity: str
    known: float
    known_sigma: float
    estimated: float
    estimated_sigma: float

    @property
    def deviation(self) -> float:
        """The difference over its sigma, which includes that of the balance or the ruler."""
        return (self.estimated - self.known) / math.hypot(self.known_sigma, self.estimated_sigma)


@dataclass(frozen=True)
class Protocol:
    """An opened set: the rig with images at rest, its loads, and the frames by file name."""

    observations: Observations
    known: tuple[KnownLoad, ...]
    frames: dict[str, ImageFrame]


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
    where = f"{folder / KNOWN}:{row.line}"

    def positive(name: str) -> float:
        text = row.cells.get(name, "")
        try:
            value = row.number(name)
        except (KeyError, ValueError):
            value = math.nan
        if not 0 < value < math.inf:
            raise InputError(f"{where}: {name} is {quoted(text)}, allowed is a number above 0")
        return value

    name, kind = row.cells.get("file_name", ""), row.cells.get("load", "")
    load = next((one for one in LOADS if one == kind), None)
    if load is None:
        raise InputError(f"{where}: load is {quoted(kind)}, allowed is one of {', '.join(LOADS)}")
    if not name or Path(name).name != name or not (folder / "images" / name).is_file():
        raise InputError(f"{where}: file_name is {quoted(name)}, allowed is a file in images/")
    weighed = load == "weight" or bool(row.cells.get("mass_g"))
    return KnownLoad(
        name,
        load,
        positive("distance_mm") * MILLIMETRE,
        positive("distance_sigma_mm") * MILLIMETRE,
        positive("mass_g") * GRAM if weighed else None,
        positive("mass_sigma_g") * GRAM if weighed else 0.0,
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
        observations = open_rig(folder)
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


def solve_known(protocol: Protocol, antenna: Antenna) -> Iterator[tuple[KnownLoad, Estimate]]:
    """Estimate every load: a push with exact_fit, a weight with hung_weight.

    Any failure is an outcome.
    """
    for load in protocol.known:
        tracker = PushTracker(antenna, exact_fit if load.load == "push" else hung_weight)
        try:
            frame = protocol.frames[load.file_name]
            yield load, tracker.solve(frame.image(), frame.readings).estimate
        except (InputError, KeyError) as error:
            message = str(error) if isinstance(error, InputError) else "metadata.csv has no row"
            yield load, Estimate(Outcome.INVALID, message)


def compare(load: KnownLoad, estimate: Estimate, rig: Rig) -> list[Comparison]:
    """Compare what balance and ruler know of a load with its estimate, as far as it has values.

    A weight's force is along gravity; of a push, a balance shows the part along gravity.
    """
    covariance, values = estimate.covariance, estimate.values
    if covariance is None:
        return []
    place = "s_c_mm" if load.load == "weight" else "x_c_mm"
    found = []
    if (distance := getattr(estimate, place)) is not None:
        known = load.distance / MILLIMETRE, load.distance_sigma / MILLIMETRE
        found.append(
            Comparison(load.file_name, load.load, place, *known, distance, estimate.sigma(place))
        )
    if load.mass is None or rig.gravity is None or "force_x_n" not in values:
        return found
    names = list(values)
    along = np.zeros(len(names))
    along[names.index("force_x_n")] = math.cos(rig.gravity.direction)
    along[names.index("force_y_n")] = math.sin(rig.gravity.direction)
    force = abs(float(along @ np.array(list(values.values()))))
    sigma = math.sqrt(max(float(along @ covariance @ along), 0.0))
    weight = load.mass * GRAVITY
    weight_sigma = math.hypot(load.mass_sigma * GRAVITY, load.mass * GRAVITY_SIGMA)
    found.append(
        Comparison(load.file_name, load.load, "force_n", weight, weight_sigma, force, sigma)
    )
    return found


class Score(NamedTuple):
    """Score of one quantity of one kind of load.

    `n_loads` loads were compared. `error_pct` is the median error, of the known value for a force
    and of the beam's length for a place; `known_pct` is what balance or ruler leave of it, the
    median sigma. `rms_deviation` is 1 if all sigmas are right.
    """

    load: Load
    quantity: str
    n_loads: int
    error_pct: float
    known_pct: float
    rms_deviation: float


def scores(comparisons: Sequence[Comparison], rig: Rig) -> list[Score]:
    """Score estimates against balance and ruler, per kind of load and quantity."""
    found = []
    for load, quantity in dict.fromkeys((one.load, one.quantity) for one in comparisons):
        ours = [one for one in comparisons if (one.load, one.quantity) == (load, quantity)]
        known, known_sigma, estimated = np.array(
            [(one.known, one.known_sigma, one.estimated) for one in ours]
        ).T
        unit = known if quantity == "force_n" else rig.beam.length / MILLIMETRE
        found.append(
            Score(
                load,
                quantity,
                len(ours),
                100 * float(np.median(np.abs(estimated - known) / unit)),
                100 * float(np.median(known_sigma / unit)),
                float(np.sqrt(np.mean([one.deviation**2 for one in ours]))),
            )
        )
    return found


def mistakes(
    answers: Sequence[tuple[KnownLoad, Estimate]], comparisons: Sequence[Comparison]
) -> Iterator[Finding]:
    """List loads without an estimate, and loads that their images contradict."""
    for load, estimate in answers:
        if not estimate.outcome.has_values:
            message = estimate.message or estimate.outcome.sentence
            yield Finding("no_estimate", f"{load.file_name}: {estimate.outcome}: {message}")
    for one in comparisons:
        if abs(one.deviation) > MISTAKE:
            yield Finding(
                "contradicted",
                f"{one.file_name}: {one.quantity} is {one.known:.4g} +- {one.known_sigma:.2g} by "
                f"{KNOWN} and {one.estimated:.4g} +- {one.estimated_sigma:.2g} by the image: check "
                "the row, and what touches the beam",
            )
