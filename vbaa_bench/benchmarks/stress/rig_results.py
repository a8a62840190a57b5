"""Run one row on one rig: perturb, set up, solve every frame, compare with the truth."""

import tempfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.observation import open_observations
from solver.instrument.units import MILLIMETRE
from solver.lab.check import calibration_report
from solver.lab.shots import Files
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker
from vbaa_bench.benchmarks.stress.recording import (
    NotApplicableError,
    read_recording,
    write_recording,
)
from vbaa_bench.benchmarks.stress.rows import UNKNOWN, Row
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.scored_quantities import CONSISTENT_SIGMAS

# With fewer visible points a failure outcome is consistent (the project's definition).
MIN_POINTS = 8
# Replaces an outcome where `set_up` refused the whole rig.
REFUSED = "refused"


@dataclass(frozen=True)
class FrameResult:
    """Result of one frame: its outcome, and error and stated sigma of x_c in % of L.

    Both are None if there is no estimate; `sigma_pct` also if none was stated. `consistent`,
    `detected` and `false` are verdicts, see `score_frame`.
    """

    frame_id: str
    outcome: str
    message: str
    points: int
    error_pct: float | None
    sigma_pct: float | None
    consistent: bool
    detected: bool
    false: bool


@dataclass(frozen=True)
class RigResult:
    """Result of one row on one rig.

    `findings` are those of `check`; `refusal` is why `set_up` failed. Frames without a true
    contact are left out. `skipped` is the reason why the row was not run.
    """

    rig: int
    findings: tuple[str, ...] = ()
    refusal: str = ""
    skipped: str = ""
    frames: tuple[FrameResult, ...] = ()


@dataclass(frozen=True)
class SolverResult:
    """Result of the solver for one frame, or for the whole rig, with its number of points."""

    outcome: str
    message: str = ""
    points: int = 0
    x_c: float | None = None
    sigma: float | None = None


class Solution(NamedTuple):
    """Findings of `check` by name, why `set_up` refused ("" if not), and answers by frame."""

    findings: tuple[str, ...]
    refusal: str
    answers: Mapping[str, SolverResult]


def stress_rig(root: Path, number: int, row: Row, method: str, seed: int) -> RigResult:
    """Perturb the dataset at `root`, rig `number`, and solve it in the ordinary way.

    Raises InputError if the dataset is incomplete.
    """
    layout = Layout(root)
    truth = open_truth(layout.truth)
    length = truth.manifest["true_rig"]["beam_length_mm"] * MILLIMETRE
    true_contacts = {
        frame_id: x_c * MILLIMETRE
        for frame_id, x_c in truth.frames.select("frame_id", "x_c_mm").iter_rows()
        if x_c is not None
    }
    recording = read_recording(layout.observations, truth.camera)
    random = np.random.default_rng([seed, number, zlib.crc32(row.name.encode())])
    try:
        perturbed = row.perturb(recording, random)
    except NotApplicableError as error:
        return RigResult(number, skipped=str(error))
    with tempfile.TemporaryDirectory(prefix="vbaa-stress-") as folder:
        target = Path(folder) / "observations"
        write_recording(perturbed, layout.observations, target)
        findings, refusal, answers = solve_observations(target, method)
    refused = SolverResult(REFUSED, refusal)
    return RigResult(
        number,
        findings,
        refusal,
        frames=tuple(
            score_frame(frame_id, answers.get(frame_id, refused), x_c, length, row, findings)
            for frame_id, x_c in sorted(true_contacts.items())
        ),
    )


def solve_observations(observations: Path, method: str) -> Solution:
    """Check and solve observations with a method of the solver."""
    try:
        opened = open_observations(observations)
        antenna = set_up(opened)
        findings = tuple(
            finding.name for finding in getattr(calibration_report(antenna), "findings", ())
        )
    except InputError as error:
        return Solution((), str(error), {})
    except Exception as error:  # noqa: BLE001 - a traceback of set_up is a result of this test
        message = f"{type(error).__name__}: {error}"
        crashed = SolverResult(Outcome.CRASHED, message)
        return Solution((), message, dict.fromkeys(_frame_ids(observations), crashed))
    tracker = PushTracker(antenna, METHODS[method])
    answers = {}
    for shot in Files(opened.frames):
        result = tracker.solve(shot.pixels(), shot.readings, shot.push_id)
        points = 0 if result.line is None else len(result.line.points)
        answers[shot.name] = _answer(result.estimate, points)
    return Solution(findings, "", answers)


def score_frame(
    frame_id: str,
    answer: SolverResult,
    true_x_c: float,
    length: float,
    row: Row,
    findings: tuple[str, ...],
) -> FrameResult:
    """Score one answer as detected, false or consistent.

    Detected: `set_up` refused, or a finding or the outcome is one of the row's signs, or the
    message contains one; in a row without signs, any finding, a refusal or a moved camera. False:
    answered, and more than 3 sigma off; or "no contact", as every frame has a true contact.
    Consistent: answered within 3 sigma; or not answered because the perturbation was detected, or
    because fewer than 8 points are visible.
    """
    error = None if answer.x_c is None else 100 * (answer.x_c - true_x_c) / length
    sigma = None if answer.sigma is None else 100 * answer.sigma / length
    within = error is not None and sigma is not None and abs(error) <= CONSISTENT_SIGMAS * sigma
    labels = {*findings, answer.outcome}
    signs = row.signs or {*findings, Outcome.CAMERA_MOVED} - UNKNOWN
    in_message = any(sign in answer.message for sign in row.signs)
    detected = answer.outcome == REFUSED or bool(labels & signs) or in_message
    failures = (Outcome.NO_CONTACT, Outcome.CRASHED)
    identified = detected and bool(row.signs)
    too_few = answer.points < MIN_POINTS and answer.outcome != REFUSED
    return FrameResult(
        frame_id,
        answer.outcome,
        answer.message,
        answer.points,
        error,
        sigma,
        consistent=within
        or (error is None and answer.outcome not in failures and (identified or too_few)),
        detected=detected,
        false=answer.outcome == Outcome.NO_CONTACT or (error is not None and not within),
    )


def _answer(estimate: Estimate, points: int) -> SolverResult:
    x_c = estimate.values.get("x_c_m")
    has_sigma = x_c is not None and estimate.covariance is not None
    sigma = estimate.sigma("x_c_m") if has_sigma else None
    return SolverResult(str(estimate.outcome), estimate.message, points, x_c, sigma)


def _frame_ids(observations: Path) -> list[str]:
    return [frame.frame_id for frame in open_observations(observations)]
