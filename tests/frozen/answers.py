"""Answers to the frozen measurements, and to drawn photographs and outlines."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.learning.learn import LearnedBeam, learn_beam
from solver.methods import LEARNING, METHODS
from solver.outline.contacts import Contacts
from solver.outline.fit import fit_outline
from solver.photographs.solve import answer_photos
from tests.frozen.measurements import Frame, whole
from tests.photo_sets import SetSpec, drawn_set

# Least pushes of a dataset whose beam is learned. Chosen: learning takes seconds.
_LEARNED_FROM = 3
PHOTOGRAPHS, OUTLINES = 12, 6


class Answer(NamedTuple):
    """An outcome, values by name, their sigmas (n,), and their correlations (n, n)."""

    outcome: str
    names: tuple[str, ...]
    values: Floats
    sigmas: Floats
    correlation: Floats


def answers(frames: Sequence[Frame]) -> Iterator[tuple[str, Answer]]:
    """Yield the answer to each question, by its name: method or solver, dataset, frame."""
    beams = dict(_learned(frames))
    for frame, measurement in zip(frames, whole(frames), strict=True):
        for name, method in METHODS.items():
            if name not in LEARNING:
                yield f"{name} {frame.dataset} {frame.name}", _of_estimate(method(measurement))
            elif (beam := beams.get(frame.dataset)) is not None:
                estimate = method(replace(measurement, rig=beam.rig(measurement.rig)))
                yield f"{name} {frame.dataset} {frame.name}", _of_estimate(estimate)
    yield from _of_photographs()
    yield from _of_outlines()


def save(path: Path, given: Mapping[str, Answer]) -> None:
    """Write answers as plain arrays."""
    np.savez_compressed(
        path,
        questions=np.array(list(given)),
        outcomes=np.array([one.outcome for one in given.values()]),
        names=np.array([" ".join(one.names) for one in given.values()]),
        values=_joined([one.values for one in given.values()]),
        sigmas=_joined([one.sigmas for one in given.values()]).astype(np.float32),
        # Half precision: three digits.
        correlations=_joined(
            [one.correlation[_below(len(one.names))] for one in given.values()]
        ).astype(np.float16),
    )


def load(path: Path) -> dict[str, Answer]:
    """Read answers, in the order in which they were written."""
    with np.load(path) as stored:
        arrays: dict[str, Any] = {key: stored[key] for key in stored.files}
    given, at, pairs_at = {}, 0, 0
    for question, outcome, text in zip(
        arrays["questions"], arrays["outcomes"], arrays["names"], strict=True
    ):
        names = tuple(str(text).split())
        n, below = len(names), _below(len(names))
        pairs = len(below[0])
        correlation = np.eye(n)
        correlation[below] = arrays["correlations"][pairs_at : pairs_at + pairs]
        given[str(question)] = Answer(
            str(outcome),
            names,
            arrays["values"][at : at + n],
            arrays["sigmas"][at : at + n].astype(float),
            correlation + np.tril(correlation, -1).T,
        )
        at, pairs_at = at + n, pairs_at + pairs
    return given


def _joined(parts: Sequence[Floats]) -> Floats:
    return np.concatenate([np.asarray(part, dtype=float) for part in parts])


def _below(n: int) -> tuple[Any, Any]:
    return np.tril_indices(n, -1)


def _of_estimate(estimate: Estimate) -> Answer:
    names = tuple(estimate.values)
    values = np.array([estimate.values[name] for name in names])
    if estimate.covariance is None:
        return _independent(estimate.outcome, names, values, np.full(len(names), np.nan))
    sigmas = np.sqrt(np.diag(estimate.covariance))
    scale = np.where(sigmas > 0, sigmas, 1.0)
    correlation = estimate.covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)
    return Answer(str(estimate.outcome), names, values, sigmas, correlation)


def _independent(outcome: str, names: Sequence[str], values: Floats, sigmas: Floats) -> Answer:
    return Answer(str(outcome), tuple(names), values, sigmas, np.eye(len(names)))


def _learned(frames: Sequence[Frame]) -> Iterator[tuple[str, LearnedBeam]]:
    """Learn the beam of each dataset that has enough pushes."""
    pushes: dict[str, dict[str, list[Measurement]]] = {}
    for frame in frames:
        of_dataset = pushes.setdefault(frame.dataset, {})
        of_dataset.setdefault(frame.push, []).append(frame.measurement)
    for dataset, by_push in pushes.items():
        if len(by_push) >= _LEARNED_FROM:
            try:
                yield dataset, learn_beam(list(by_push.values()))
            except InputError:
                continue


def _of_photographs() -> Iterator[tuple[str, Answer]]:
    for seed in range(PHOTOGRAPHS):
        spec = SetSpec(kind=("weight", "push")[seed % 2], marks=3 * (seed % 3 == 0))
        drawn = drawn_set(seed, spec)
        found = answer_photos(drawn.photos, drawn.shown, {})
        parts = {str(i): one.values for i, one in enumerate(found.answers)} | {
            "shared": found.shared
        }
        for name, values in parts.items():
            outcome = found.answers[int(name)].outcome if name != "shared" else Outcome.CONTACT
            yield (
                f"photos {seed} {name}",
                _independent(
                    outcome,
                    tuple(values),
                    np.array([one.value for one in values.values()]),
                    np.array([one.sigma for one in values.values()]),
                ),
            )


def _of_outlines() -> Iterator[tuple[str, Answer]]:
    for seed in range(OUTLINES):
        outline = fit_outline(_contacts(np.random.default_rng(seed), count=24 + 12 * seed))
        along = np.column_stack([np.cos(outline.normals), np.sin(outline.normals)])
        chosen = slice(None, None, 12)
        extents = (outline.points * along).sum(axis=1)[chosen]
        values = np.append(extents, outline.correction)
        sigmas = np.append(outline.sigmas[chosen], outline.correction_sigmas)
        names = [f"{'extent' if i < len(extents) else 'shift'}_{i}" for i in range(len(values))]
        closed = "closed" if outline.closed else "open"
        yield f"outline {seed} all", _independent(closed, names, values, sigmas)


def _contacts(random: np.random.Generator, count: int) -> Contacts:
    """Draw contacts with an ellipse of 40 and 25 mm, 0.05 mm along it and 0.02 mm across it."""
    normals = np.sort(random.uniform(0, 2 * math.pi, count))
    outward = np.column_stack([np.cos(normals), np.sin(normals)])
    tangent = np.column_stack([-outward[:, 1], outward[:, 0]])
    extents = np.hypot(0.040 * outward[:, 0], 0.025 * outward[:, 1])
    points = np.array([0.040**2, 0.025**2]) * outward / extents[:, None]
    errors = random.standard_normal((count, 2)) * [5e-5, 2e-5]
    points = points + errors[:, :1] * tangent + errors[:, 1:] * outward
    axes = np.stack([tangent, outward], axis=2)
    shared = np.zeros((count, 2, 3))
    shared[:, :, :2] = np.eye(2)
    shared[:, :, 2] = random.uniform(-0.04, 0.08, count)[:, None] * outward
    return Contacts(
        tuple(map(str, range(count))),
        points,
        normals,
        axes @ np.diag([25e-10, 4e-10]) @ axes.transpose(0, 2, 1),
        shared,
        np.array([1e-5, 1e-5, 2e-4]),
    )
