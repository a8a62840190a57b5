"""Check a method of the user's own on a dozen frames, before a long run.

The method runs twice, in two processes, as `solve` would run it. Its estimates are compared with
the truth to recognise wrong units, a wrong frame of reference, and covariances that no correct
method states. These tests are about mistakes, not about accuracy.
"""

import math
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.estimate import Outcome
from solver.instrument.files import write_text
from solver.instrument.observation import Observations, open_observations
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.generation.generate import generate
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.isolation.reference_kernel import PROCESSOR_COLUMN, REFERENCE_COLUMN
from vbaa_bench.scoring.isolation.runs import MethodRun, solve
from vbaa_bench.scoring.predictions import read_predictions
from vbaa_bench.scoring.scored_quantities import COMPONENTS, SCORED_QUANTITIES, ScoredQuantity
from vbaa_bench.scoring.statistics import CONTACTS, LARGEST, MEDIAN, RMS
from vbaa_bench.scoring.wrong_units import NEAR, factors

FRAMES: Final = 12
# Three pushes of four frames, of which the first is not yet in contact. The object is inclined, so
# that psi is not zero. Chosen: it renders in half a minute.
SCENE: Final = """title: Three pushes, to check a method
seed: 1
camera:
  width_px: 512
  height_px: 176
  position_mm: [120.0, 22.0, 360.0]
  look_at_mm: [120.6, 22.0, 0.0]
calibration: {columns: 20, rows: 5, square_mm: 10, center_mm: [120.0, 22.0], views: 6}
sensor: {rest_images: 2}
background: {distance_mm: 60}
object: {kind: knife_edge, length_mm: 100}
layers: []
pushes:
  contact_distance_mm: [80, 130, 190]
  pushing_angle_deg: [-1, 3, 6, 10]
  normal_deg: [20]
"""

# Columns that differ between any two runs.
_TIMES: Final = ("image_ms", PROCESSOR_COLUMN, REFERENCE_COLUMN)

# Units in which a method states its values, by the suffixes of columns of predictions.
_UNITS: Final = {"mm": "m", "deg": "radians", "n": "N", "mm_per_n": "m/N", "n_per_m": "N/m"}
# Frames of reference of the quantities whose sign may be wrong.
_SIGNS: Final = {
    "x_c": "x points from the clamp to the tip",
    "s_c": "arc length is measured from the clamp to the tip",
    "y_c": "y points to the side to which the beam bends",
    "theta_c": "the slope is positive where the beam bends to +y",
    "psi": "psi is positive where plane D is inclined towards the camera, to +z",
}
_SIGN: Final = "see the frames Sigma_a and Sigma_o in docs/data_dictionary.md"
# Truths below this share of the largest one are left out of ratios. Chosen: a tenth, so that small
# errors of an estimate do not decide its ratio.
_SMALL: Final = 0.1
# RMS errors of more stated sigmas, or fewer than its inverse, are noted. Chosen: the middle, in
# logarithms, between a correct sigma and one in mm instead of m.
_SIGMAS: Final = math.sqrt(1000)


_ORDER: Final = ("wrong", "note", "ok")


class Finding(NamedTuple):
    """A line of the check: `status` is "ok", "note" or "wrong"."""

    status: str
    sentence: str


def built_in_dataset(folder: Path, variant: str, workers: int) -> Path:
    """Render the built-in dataset into a folder, unless it is there. Raises InputError."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "scene.yaml"
    write_text(scene, SCENE)
    root = folder / "dataset"
    generate(load_scene(scene), root, variant, workers, lambda _done, _total: None)
    return root


def check_method(method: str, root: Path, memory_gb: float) -> list[Finding]:
    """Run a method twice on FRAMES frames of a dataset; list what is right and wrong.

    Raises InputError if the method cannot be found, if the rig cannot be set up, and for a damaged
    dataset.
    """
    layout = Layout(root)
    observations = open_observations(layout.observations)
    truth = open_truth(layout.truth, centrelines=False)
    chosen = _chosen_frames(observations)
    with tempfile.TemporaryDirectory(prefix="vbaa-check-") as folder:
        paths = [Path(folder) / f"{name}.csv" for name in ("first", "second")]
        runs = [
            solve(layout, method, path, 1, memory_gb=memory_gb, frames=chosen) for path in paths
        ]
        if runs[0].refusal:
            raise InputError(runs[0].refusal)
        first, second = (read_predictions(path) for path in paths)
    return compare(truth, runs[0], first, second)


def compare(
    truth: Truth, run: MethodRun, first: pl.DataFrame, second: pl.DataFrame
) -> list[Finding]:
    """List what is right and wrong in a run, from the tables of two runs on the same frames."""
    frames = truth.frames.join(first, on="frame_id", how="semi")
    scores = score_frames(replace(truth, frames=frames), first, "checked", "checked")
    quantities = (*SCORED_QUANTITIES, *COMPONENTS)
    findings = [
        *_failures(run, scores),
        *(Finding("wrong", f"{s} ({n} frames)") for s, n in run.faults.items()),
        *_repeatable(first, second),
        *_estimated(scores),
        *_places(truth, scores),
        *(finding for quantity in quantities for finding in _unit_and_sign(scores, quantity)),
        *(finding for quantity in quantities for finding in _sigmas(scores, quantity)),
        *_costs(run, scores),
    ]
    # "wrong" first.
    return sorted(findings, key=lambda finding: _ORDER.index(finding.status))


def _chosen_frames(observations: Observations) -> list[int]:
    """Choose whole pushes that are spread over the dataset, until they have FRAMES frames."""
    pushes: dict[str, list[int]] = {}
    for index, frame in enumerate(observations.frames):
        pushes.setdefault(frame.push_id, []).append(index)
    groups = list(pushes.values())
    count = max(1, round(FRAMES / len(groups[0])))
    places = sorted({int(i) for i in np.linspace(0, len(groups) - 1, count)})
    return sorted(index for place in places for index in groups[place])[:FRAMES]


def _failures(run: MethodRun, scores: pl.DataFrame) -> Iterator[Finding]:
    crashed = scores.filter("crashed")
    for (message,), rows in crashed.group_by("message", maintain_order=True):
        yield Finding("wrong", f"{rows.height} of {scores.height} frames crashed: {message}")
    if run.traceback:
        yield Finding("note", f"the first traceback:\n{run.traceback.rstrip()}")
    free = scores.filter(pl.col("free") & ~pl.col("failed"))
    claimed = scores.filter(pl.col("free") & pl.col("outcome").str.contains("contact"))
    claimed = claimed.filter(pl.col("outcome") != str(Outcome.NO_CONTACT))
    if claimed.height:
        yield Finding(
            "note",
            f"{claimed.height} of {claimed.height + free.height} frames without contact are "
            'answered with a contact; return the outcome "no contact" instead',
        )
    if scores.height > crashed.height:
        counts = scores.filter(~pl.col("crashed"))["outcome"].value_counts(sort=True)
        outcomes = ", ".join(f"{count} {outcome}" for outcome, count in counts.iter_rows())
        yield Finding("ok", f"{scores.height - crashed.height} frames solved: {outcomes}")


def _repeatable(first: pl.DataFrame, second: pl.DataFrame) -> Iterator[Finding]:
    """Compare two runs on the same frames."""
    apart = [
        name
        for name in first.columns
        if name not in _TIMES and not first[name].equals(second[name], null_equal=True)
    ]
    if apart:
        yield Finding(
            "wrong",
            f"a second run gives other results for the same frames: {', '.join(apart)}; use a "
            "random generator with a fixed seed, and keep no state between frames",
        )
    elif not first["outcome"].eq(str(Outcome.CRASHED)).all():
        yield Finding("ok", "a second run gives the same results")


def _estimated(scores: pl.DataFrame) -> Iterator[Finding]:
    answered = scores.filter(pl.col("outcome").is_in(CONTACTS))
    names = [q.column for q in SCORED_QUANTITIES if answered[q.column].count()]
    if not answered.height:
        return
    if not {"x_c_mm", "force_n"} & set(names):
        yield Finding("wrong", "neither x_c_m nor force_n is estimated, one is required")
    for name in set(names) & {"x_c_mm", "force_n"}:
        if answered[name].null_count():
            yield Finding(
                "wrong",
                f"{name} is missing in {answered[name].null_count()} of {answered.height} "
                "answered frames, which count as failures",
            )
    yield Finding("ok", f"estimated, in the units of the table: {', '.join(names)}")


def _places(truth: Truth, scores: pl.DataFrame) -> Iterator[Finding]:
    """Recognise contact distances that are measured from the tip."""
    length = truth.manifest["true_rig"]["beam_length_mm"]
    pairs = scores.select("x_c_mm", "true_x_c_mm").drop_nulls()
    if pairs.height < 3:
        return
    estimated, true = (pairs[name].to_numpy() for name in pairs.columns)
    from_tip = MEDIAN.of(np.abs(length - estimated - true))
    # The middle of the beam is equally far from both ends.
    if from_tip < 0.05 * length < MEDIAN.of(np.abs(estimated - true)):
        yield Finding("wrong", "x_c_m is measured from the tip; measure it from the clamp")


def _unit_and_sign(scores: pl.DataFrame, quantity: ScoredQuantity) -> Iterator[Finding]:
    """Compare the median ratio of estimates to truths with the factors of wrong units."""
    ratios = _ratios(scores, quantity)
    if len(ratios) < 3:
        return
    ratio = MEDIAN.of(ratios)
    unit = _UNITS.get(quantity.unit)
    wrong = {} if unit is None else factors(unit)
    if not ratio:
        yield Finding("note", f"{quantity.column} is 0 in most frames")
        return
    factor = min((1.0, *wrong), key=lambda value: abs(math.log(abs(ratio) / value)))
    distance = math.exp(abs(math.log(abs(ratio) / factor)))
    head = f"{quantity.column} is {ratio:.3g} times its true value in the median"
    if ratio < 0:
        # A sign that is wrong in some frames only is an error, not a frame of reference.
        same = float(np.mean(ratios < 0))
        where = _SIGNS.get(quantity.name, _SIGN)
        if same > 0.9:
            yield Finding("wrong", f"{head}: its sign is reversed; {where}")
    if factor != 1 and distance < NEAR:
        yield Finding("wrong", f"{head}: it seems to be in {wrong[factor]} instead of {unit}")
    elif distance > NEAR:
        yield Finding("wrong", f"{head}: is it in the unit and of the place that it should be?")


def _ratios(scores: pl.DataFrame, quantity: ScoredQuantity) -> Floats:
    """Compute estimate over truth for the frames whose truth is not small."""
    true = pl.col(quantity.truth)
    pairs = scores.filter(~pl.col("free")).select(quantity.column, quantity.truth).drop_nulls()
    pairs = pairs.filter((true != 0) & (true.abs() > _SMALL * true.abs().max()))
    return np.asarray(pairs[quantity.column].to_numpy() / pairs[quantity.truth].to_numpy())


def _sigmas(scores: pl.DataFrame, quantity: ScoredQuantity) -> Iterator[Finding]:
    in_sigmas = scores[quantity.in_sigmas].drop_nulls().to_numpy()
    if len(in_sigmas) < 3:
        return
    rms = RMS.of(in_sigmas)
    if not 1 / _SIGMAS < rms < _SIGMAS:
        yield Finding(
            "note",
            f"the RMS error of {quantity.column} is {rms:.3g} stated sigmas; is the covariance in "
            "squared SI units, in the order of the values? Or does the method neglect something, "
            "such as the inclination of the object?",
        )


def _costs(run: MethodRun, scores: pl.DataFrame) -> Iterator[Finding]:
    times = scores.filter(~pl.col("crashed"))["image_ms"].drop_nulls().to_numpy()
    if len(times):
        median, worst = MEDIAN.of(times), LARGEST.of(times)
        minutes = median * 1e5 / 6e4
        yield Finding(
            "ok",
            f"{median:.3g} ms per frame, centreline included, at most "
            f"{worst:.3g} ms; 100,000 frames take {minutes:.3g} minutes",
        )
    if run.peak_mb is not None:
        yield Finding("ok", f"{run.peak_mb:.0f} MB of memory, images and libraries included")
