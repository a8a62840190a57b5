"""What learning the beam is worth: the exact fit before and after, on pushes not learned from.

In a dataset with the split "learn", the beam is learned from it and tested on all others; in
others, the pushes to learn from are drawn at random, several times. The rigs of a collection are
pooled.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from results.learned_beam.table import Errors
from solver.antenna import Antenna
from solver.instrument.arrays import Floats
from solver.instrument.errors import DamageError, InputError
from solver.instrument.estimate import Estimate
from solver.instrument.image_frame import LEARN
from solver.instrument.measurement import Measurement
from solver.instrument.observation import Observations, open_observations
from solver.instrument.rig import Rig
from solver.instrument.units import MILLIMETRE, PERCENT
from solver.learning.clamp_offset import ObjectRadius
from solver.learning.frames import measurement_of
from solver.learning.known_force import rig_with_force
from solver.learning.learn import learn_beam
from solver.methods.exact_fit import exact_fit
from solver.methods.hung_weight import hung_weight
from solver.set_up import set_up
from solver.tracker import run_method
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.information import scored_limits

# Sigma of a known radius of objects [m]. Chosen: that of a caliper.
_RADIUS_SIGMA: Final = 1e-4
# Information sets of both beams.
STATED, LEARNED = "planar", "learned"


class _Frame(NamedTuple):
    """A frame's measurement, its push and split, its true contact distance [m] and force [N].

    `world` (2,) [m] is its true contact in Sigma_o. `limits` are those of the contact distance [m]
    by information set.
    """

    measurement: Measurement
    push: str
    split: str
    x_c: float
    force: float
    world: Floats
    limits: Mapping[str, float]


def measure(
    roots: Sequence[Path],
    pushes: int,
    draws: int,
    seed: int,
    force_sigma_pct: float | None = None,
    object_radius_mm: float | None = None,
    weights: Path | None = None,
    progress: Callable[[], None] = lambda: None,
) -> list[Errors]:
    """Estimate with the stated and the learned beam; two results per dataset or collection.

    Where there is no split to learn from, `pushes` pushes are drawn `draws` times, as functions of
    `seed`. With `force_sigma_pct`, the force of one frame to learn from is known with this sigma,
    as from a balance, or, if `weights` is a dataset of hung weights on the same rig, the weight in
    one of its frames; with `object_radius_mm` the radius of the objects is known to 0.1 mm. Limits
    are those of the dataset, if they were computed. `progress` is called after each dataset. Raises
    InputError for a damaged dataset, and where no beam can be learned from any.
    """
    results = []
    radius = None
    if object_radius_mm is not None:
        radius = ObjectRadius(object_radius_mm * MILLIMETRE, _RADIUS_SIGMA)
    if weights is not None and force_sigma_pct is None:
        raise InputError("a dataset of weights is given, needed is the sigma of the known force")
    weight = None if weights is None else _most_bent(_measured(Layout(weights)))
    known = _Known(force_sigma_pct, radius, weight)
    for root in roots:
        frames, stated, learned = 0, list[Floats](), list[Floats]()
        for layout in _datasets(root):
            for before, after in _trials(layout, pushes, draws, seed, known):
                frames += len(before)
                stated += [row for row in before if row is not None]
                learned += [row for row in after if row is not None]
            progress()
        if not frames:
            raise InputError(
                f"{root}: no beam can be learned from {pushes} pushes with a contact and judged by "
                "others; it may have too few"
            )
        results.append(Errors(root.name, "as stated", frames, np.array(stated)))
        results.append(Errors(root.name, "learned", frames, np.array(learned)))
    return results


def count_datasets(roots: Sequence[Path]) -> int:
    """Count the datasets, those of collections included."""
    return sum(len(_datasets(root)) for root in roots)


def _datasets(root: Path) -> list[Layout]:
    return list(CollectionLayout(root).rigs().values()) if is_collection(root) else [Layout(root)]


Rows = list[Floats | None]


class _Known(NamedTuple):
    """Relative sigma [%] of one force, radius of the objects, and a frame of a hung weight.

    None where they are unknown. Without a weight the force is that of a contact.
    """

    force_sigma_pct: float | None
    radius: ObjectRadius | None
    weight: _Frame | None

    def with_force(self, rig: Rig, pushed: _Frame, random: np.random.Generator) -> Rig:
        """Give the rig EI from the weight, or else from the contact of the frame `pushed`."""
        if self.force_sigma_pct is None:
            return rig
        loaded = self.weight or pushed
        # Pushes do not need it: their rig.json may not state it.
        rig = replace(rig, gravity=loaded.measurement.rig.gravity)
        sigma = loaded.force * self.force_sigma_pct * PERCENT
        force = loaded.force + sigma * random.standard_normal()
        method = exact_fit if self.weight is None else hung_weight
        return rig_with_force(rig, loaded.measurement, force, sigma, method)


def _trials(
    layout: Layout, pushes: int, draws: int, seed: int, known: _Known
) -> Iterator[tuple[Rows, Rows]]:
    """Yield the errors of the tested frames before and after learning; None for no answer."""
    observations = open_observations(layout.observations)
    rows = _rows(layout)
    if known.weight is not None and known.weight.measurement.rig.beam != observations.rig.beam:
        raise InputError(
            f"{layout.root}: the beam of its rig.json is not that of the dataset of weights, "
            "needed is a weight on the same beam"
        )
    try:
        antenna = set_up(observations)
    except DamageError:
        raise
    except InputError:  # the images do not show the rig's beam: no frame is answered
        touching = (rows[image.frame_id]["x_c_mm"] is not None for image in observations)
        unanswered: Rows = [None] * sum(touching)
        yield unanswered, unanswered
        return
    frames = _frames(antenna, observations, rows, _limits(layout))
    names = list(dict.fromkeys(frame.push for frame in frames))
    splits = {frame.push for frame in frames if frame.split == LEARN}
    random = np.random.default_rng([seed, len(names)])
    choices = (
        [splits] if splits else [set(random.permutation(names)[:pushes]) for _ in range(draws)]
    )
    for chosen in choices:
        tested = [frame for frame in frames if frame.push not in chosen]
        before = [_errors(frame, exact_fit_of(frame.measurement), STATED) for frame in tested]
        to_learn = [[f for f in frames if f.push == name] for name in sorted(chosen)]
        try:
            measured = [[frame.measurement for frame in push] for push in to_learn]
            beam = learn_beam(measured, known.radius)
        except InputError:  # too few pushes with a contact: the beam stays as stated
            yield before, before
            continue
        rig = beam.rig(frames[0].measurement.rig)
        rig = known.with_force(rig, _most_bent(to_learn[0]), random)
        learned = (replace(frame.measurement, rig=rig) for frame in tested)
        yield (
            before,
            [
                _errors(frame, exact_fit_of(measurement), LEARNED)
                for frame, measurement in zip(tested, learned, strict=True)
            ],
        )


def _rows(layout: Layout) -> Mapping[str, Mapping[str, Any]]:
    """Read the rows of a dataset's truth by frame."""
    truth = open_truth(layout.truth, centrelines=False).frames
    return {row["frame_id"]: row for row in truth.iter_rows(named=True)}


def _measured(layout: Layout) -> list[_Frame]:
    """Set up the rig of a dataset, and measure its frames. Raises InputError."""
    observations = open_observations(layout.observations)
    return _frames(set_up(observations), observations, _rows(layout), {})


def _most_bent(frames: Sequence[_Frame]) -> _Frame:
    """Return the frame of the largest force."""
    return max(frames, key=lambda frame: frame.force)


def exact_fit_of(measurement: Measurement) -> Estimate:
    """Estimate by the exact fit; any failure is an outcome."""
    return run_method(exact_fit, measurement)


def _errors(frame: _Frame, estimate: Estimate, information: str) -> Floats | None:
    if not estimate.values:
        return None
    length = frame.measurement.rig.beam.length * PERCENT
    relative = frame.force * PERCENT
    distance, sigmas = np.nan, np.nan
    if "contact_world_x_m" in estimate.values:
        names = ("contact_world_x_m", "contact_world_y_m")
        error = np.array([estimate.values[name] for name in names]) - frame.world
        distance = float(np.hypot(*error))
        sigmas = float(np.max(np.abs(error) / [estimate.sigma(name) for name in names]))
    return np.array(
        [
            (estimate.values["x_c_m"] - frame.x_c) / length,
            estimate.sigma("x_c_m") / length,
            (estimate.values["force_n"] - frame.force) / relative,
            estimate.sigma("force_n") / relative,
            frame.limits.get(information, np.nan) / length,
            distance,
            sigmas,
        ]
    )


def _frames(
    antenna: Antenna,
    observations: Observations,
    rows: Mapping[str, Mapping[str, Any]],
    limits: Mapping[str, Mapping[str, float]],
) -> list[_Frame]:
    """Measure the frames of a dataset that have a contact, in its `rows`, and show the beam."""
    frames = []
    for image in observations:
        row = rows[image.frame_id]
        measurement = None if row["x_c_mm"] is None else measurement_of(antenna, image)
        if measurement is not None:
            x_c = row["x_c_mm"] * MILLIMETRE
            push = image.push_id or image.frame_id
            world = np.array(row["contact_world_mm"][:2]) * MILLIMETRE
            of_frame = limits.get(image.frame_id, {})
            frames.append(
                _Frame(measurement, push, image.split, x_c, row["force_n"], world, of_frame)
            )
    return frames


def _limits(layout: Layout) -> Mapping[str, Mapping[str, float]]:
    """Read the limits of x_c [m] by frame and information set; none were computed by default."""
    table = scored_limits(layout)
    limits: dict[str, dict[str, float]] = {}
    if table is not None:
        columns = table.select("frame_id", "information", "x_c_limit_mm").drop_nulls()
        for frame, information, limit in columns.iter_rows():
            limits.setdefault(frame, {})[information] = limit * MILLIMETRE
    return limits
