"""Score traced points against the middle lines of labels."""

import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

import solver
from results.tracing.cables import Stretch, stretches
from results.tracing.ridge import ridge_points
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError

# A point that is farther from the reference is not on the cable's line. Chosen: three times what
# the labels are good to.
WRONG_PX: Final = 1.5


class Case(NamedTuple):
    """Image (height, width, 3) of a cable, and the reference of a stretch."""

    name: str
    image: npt.NDArray[np.uint8]
    stretch: Stretch
    width: float


class Score(NamedTuple):
    """Score of one stretch: share of the visible reference that is covered, and errors (n,) [px].

    `within` is the share of the points within three sigmas, None without sigmas; `seconds` is the
    time of the processor.
    """

    coverage: float
    errors: Floats
    seconds: float
    pixels: int
    within: float | None = None
    message: str = ""


def cases(folder: Path, odd: bool) -> Iterator[Case]:
    """Read the images with even or odd numbers of the folder of mBEST, which has S1, S2 and S3.

    Raises InputError if there are none.
    """
    paths = sorted(folder.glob("S?/images/img*.jpg"), key=lambda path: (path.parts, len(path.stem)))
    chosen = [path for path in paths if int(path.stem[3:]) % 2 == odd]
    if not chosen:
        raise InputError(f"{folder}: has no S1/images/img0.jpg, allowed is dataset/ of mBEST")
    for path in chosen:
        image = np.asarray(cv2.imread(str(path)), np.uint8)
        file = path.parents[1] / "gt_labels" / f"{path.stem}.npy"
        labels = np.load(file, allow_pickle=False)
        for cable in np.unique(labels[labels > 0]):
            width = _width(labels == cable)
            for number, stretch in enumerate(stretches(labels, int(cable))):
                name = f"{path.parts[-3]}/{path.stem}/{cable}/{number}"
                yield Case(name, image, stretch, width)


def _width(mask: npt.NDArray[np.bool_]) -> float:
    """Estimate a cable's width [px]: its area over half its border."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    border = sum(cv2.arcLength(one, True) for one in contours)
    return 2 * float(np.count_nonzero(mask)) / max(border, 1.0)


def trace_score(case: Case) -> Score:
    """Trace a stretch between its ends by `solver.trace`, and score it."""
    start, end = case.stretch.line[[0, -1]]
    began = time.process_time()
    try:
        beam = solver.trace(case.image, (start[0], start[1]), (end[0], end[1]))
    except InputError as error:
        seconds = time.process_time() - began
        return Score(0.0, np.zeros(0), seconds, case.image[..., 0].size, None, str(error))
    score = _score(case, beam.points, time.process_time() - began)
    off, visible = _off(case.stretch, beam.points)
    within = np.abs(off) < 3 * beam.sigmas
    return score._replace(within=float(within[visible].mean()))


def ridge_score(case: Case) -> Score:
    """Follow a stretch by the baseline, which is given the width, and score it."""
    began = time.process_time()
    start, end = case.stretch.line[[0, -1]]
    points = ridge_points(case.image, start, end, case.width)
    return _score(case, points, time.process_time() - began)


def _off(stretch: Stretch, points: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Compute distances (n,) from the reference along its normals, and where it is visible."""
    nearest = cKDTree(stretch.line).query(points)[1]
    off = np.sum((points - stretch.line[nearest]) * stretch.normals[nearest], axis=1)
    return np.asarray(off), stretch.visible[nearest]


def _score(case: Case, points: Floats, seconds: float) -> Score:
    off, visible = _off(case.stretch, points)
    right = np.abs(off) < WRONG_PX
    spacing = float(np.median(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    coverage = 0.0
    if right.any():
        gap = cKDTree(points[right]).query(case.stretch.line[case.stretch.visible])[0]
        coverage = float(np.mean(gap < max(2 * spacing, 3.0) + WRONG_PX))
    return Score(coverage, np.abs(off[visible]), seconds, case.image[..., 0].size)


def figures(scores: Iterable[Score]) -> dict[str, float]:
    """Summarise scores: shares and errors of all points of all stretches."""
    every = list(scores)
    errors = np.concatenate([score.errors for score in every])
    within = [score.within for score in every if score.within is not None]
    seconds = sum(score.seconds for score in every)
    return {
        "stretches": len(every),
        "refused": sum(bool(score.message) for score in every),
        "coverage_pct": 100 * float(np.mean([score.coverage for score in every])),
        "median_px": float(np.median(errors)),
        "p95_px": float(np.quantile(errors, 0.95)),
        "wrong_pct": 100 * float(np.mean(errors > WRONG_PX)),
        "within_3_sigma_pct": 100 * float(np.mean(within)) if within else float("nan"),
        "ms": 1e3 * seconds / len(every),
        "mpx_per_s": 1e-6 * sum(score.pixels for score in every) / seconds,
    }
