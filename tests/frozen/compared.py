"""How far the answers of this version are from the frozen ones."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from tests.frozen.answers import Answer
from tests.frozen.measurements import Frame

# Chosen: values within a hundredth of their sigma, sigmas within 1 %, correlations within 0.01
# or, where they are stored in half precision, what that leaves.
VALUES_SIGMA, SIGMAS, CORRELATIONS = 0.01, 0.01, 0.01
# Relative difference of values that have no sigma.
_EXACT: Final = 1e-6
# Share of answers that must be equal within these, on the processor on which they were frozen, and
# on any. Measured: with the oldest kernels of OpenBLAS, NumPy and Numba 0.13 % differ, those at
# which an outcome is decided by rounding; four times as many are allowed.
SHARE: Final = 0.999
SHARE_ON_ANY: Final = 0.995


class Difference(NamedTuple):
    """A question whose answer differs, and how: a sentence."""

    question: str
    how: str


class Truth(NamedTuple):
    """The true contact distance, and the length of the beam [m]."""

    x_c: float
    length: float


class Compared(NamedTuple):
    """Answers of one solver: their number, those that differ, and the largest differences.

    `rmse` are those of x_c over the length, before and now.
    """

    solver: str
    answered: int
    differ: tuple[Difference, ...]
    value_sigma: float
    sigma: float
    rmse: tuple[float, float]


def compared(
    old: Mapping[str, Answer], new: Mapping[str, Answer], truths: Mapping[str, Truth]
) -> list[Compared]:
    """Compare two sets of answers, by solver; `truths` are those of frames, by dataset and frame.

    A question that only one of them answers, as where no beam can be learned, is a difference.
    """
    by_solver: dict[str, list[str]] = {}
    for question in {**old, **new}:
        by_solver.setdefault(question.partition(" ")[0], []).append(question)
    return [_of_solver(name, part, old, new, truths) for name, part in by_solver.items()]


def truths_of(frames: Sequence[Frame]) -> dict[str, Truth]:
    """Return the truth of each frame with a contact, by dataset and frame."""
    return {
        f"{one.dataset} {one.name}": Truth(one.x_c, one.measurement.rig.beam.length)
        for one in frames
        if one.x_c is not None
    }


def passes(results: Sequence[Compared], share: float = SHARE) -> bool:
    """Whether this share of answers is equal, and no solver's errors of x_c have grown."""
    count, differ = sum(one.answered for one in results), sum(len(one.differ) for one in results)
    worse = any(one.rmse[1] > (1 + SIGMAS) * one.rmse[0] for one in results)
    return differ <= (1 - share) * count and not worse


def _of_solver(
    name: str,
    questions: Sequence[str],
    old: Mapping[str, Answer],
    new: Mapping[str, Answer],
    truths: Mapping[str, Truth],
) -> Compared:
    differ, largest, errors = [], [(0.0, 0.0)], []
    for question in questions:
        if question not in old or question not in new:
            how = "is answered now" if question in new else "is not answered any more"
            differ.append(Difference(question, how))
            continue
        before, after = old[question], new[question]
        if (other := _how_names_differ(before, after)) is not None:
            differ.append(Difference(question, other))
            continue
        known = np.isfinite(before.sigmas)
        scale = np.where(known, before.sigmas, np.abs(before.values) * _EXACT / VALUES_SIGMA)
        by_value = np.abs(after.values - before.values) / np.maximum(scale, np.finfo(float).tiny)
        wide = np.maximum(before.sigmas, np.finfo(np.float32).tiny)
        by_sigma = (np.abs(after.sigmas - before.sigmas) / wide)[known]
        pairs = np.abs(after.correlation - before.correlation)
        moved, wider = by_value.max(initial=0.0), by_sigma.max(initial=0.0)
        largest.append((float(moved), float(wider)))
        if moved > VALUES_SIGMA or wider > SIGMAS or pairs.max(initial=0.0) > CORRELATIONS:
            worst = before.names[int(by_value.argmax())]
            how = f"{worst} by {moved:.3g} sigma, sigmas by {100 * wider:.3g} %"
            differ.append(Difference(question, f"{how}, correlations by {pairs.max():.2g}"))
        truth = truths.get(question.partition(" ")[2])
        if truth is not None and "x_c_m" in before.names:
            at = before.names.index("x_c_m")
            found = np.array([before.values[at], after.values[at]])
            errors.append((found - truth.x_c) / truth.length)
    rms = np.sqrt(np.mean(np.square(errors), axis=0)) if errors else np.zeros(2)
    value_sigma, sigma = np.max(largest, axis=0)
    return Compared(
        name,
        len(questions),
        tuple(differ),
        float(value_sigma),
        float(sigma),
        (float(rms[0]), float(rms[1])),
    )


def _how_names_differ(before: Answer, after: Answer) -> str | None:
    if before.outcome != after.outcome:
        return f"{before.outcome} is now {after.outcome}"
    if before.names != after.names:
        return f"values {' '.join(before.names)} are now {' '.join(after.names)}"
    return None
