"""Train a learned regressor on one dataset, and measure its errors there and on other datasets.

The regressor estimates contact distance and force from the image alone, without a centreline: thin
bright lines are enhanced and reduced to blocks of pixels, which are projected on their principal
components, and kernel ridge regression maps these to x_c / L and to the logarithm of the force. It
measures what a model loses under a light and on a ground on which it was not trained; `solver/`
does not contain it. The beam must be bright and nearly parallel to the pixel rows.

The pushes of the training dataset are divided into five folds. Five models are trained, each
without the pushes of one fold, which are then its held-out frames. All five are tried on all frames
of the other datasets. Thus all errors belong to models that were trained on equally many frames,
none of which is among those estimated. Needs the extra `learned` (scikit-learn).

The model is also an entrant of the benchmark: it can write predictions files, see docs/entrants.md.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import polars as pl

from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.observation import open_observations
from solver.lab.table import csv_text, row
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.dataset.recorded import exists, write_results
from vbaa_bench.scoring.predictions import read_predictions
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.statistics import RMS
from vbaa_bench.scoring.tables import markdown_table

# Pixels per block along rows and columns. Measured: blocks of twice the size do as well.
BLOCK_PX: Final = (16, 4)
# Height of the lines that are enhanced. Chosen: four times the beam's width on the paper's rig, so
# that smooth grounds, shadows and objects vanish.
LINE_PX: Final = 7
# Blur across the beam [px]. Chosen: several blocks, so that features vary smoothly with the shape.
BLUR_PX: Final = 8.0
FOLDS: Final = 5
# Fewer frames than this do not fill the folds of the inner cross-validation. Chosen.
MIN_FRAMES: Final = 40
# Methods of the solver that are listed beside the model, if they have been solved.
REFERENCES: Final = ("exact_fit", "exact_fit_3d")

# Heads of the columns of `cells`.
HEADS: Final = ("dataset", "estimator", "answered", "x_c, RMSE % of L", "force, RMS of ln")
LEARNED: Final = "learned"
CONSTANT: Final = "constant"

# Estimates labels (n, 2) from features (n, blocks).
Model = Callable[[Floats], Floats]


class Frames(NamedTuple):
    """The frames of a dataset whose beam touches an object.

    `features` (n, blocks) are those of their images, `labels` (n, 2) are x_c / L and ln(force / N).
    Frames of one push have the same name in `pushes` (n,). `estimates` are labels (n, 2) as
    estimated by methods of the solver, NaN for frames without an answer.
    """

    name: str
    image_px: tuple[int, int]
    pushes: np.ndarray
    features: Floats
    labels: Floats
    estimates: dict[str, Floats]


class Errors(NamedTuple):
    """Errors of one estimator on the frames of one dataset.

    `x_c_rmse_pct_L` is in % of L, `force_rms_ln` is the root mean square of ln(estimate / truth);
    both are over `answered` estimates and None without any. The model makes several for each frame
    of a dataset on which it was not trained.
    """

    dataset: str
    estimator: str
    estimates: int
    answered: int
    x_c_rmse_pct_L: float | None  # noqa: N815
    force_rms_ln: float | None


def measure(
    train: Path,
    others: Sequence[Path],
    on_fold: Callable[[], None] = lambda: None,
    *,
    with_predictions: bool = False,
) -> dict[str, Any]:
    """Train on one dataset, and try the models on its held-out frames and on other datasets.

    `on_fold` is called after each of the FOLDS models is trained. `with_predictions` also writes a
    predictions file for each dataset. Returns numbers that JSON can hold. Raises InputError, also
    if scikit-learn is missing.
    """
    _require_sklearn()
    own, *foreign = (read(root) for root in (train, *others))
    for frames in foreign:
        if frames.image_px != own.image_px:
            raise InputError(
                f"{frames.name}: has images of {_size(frames.image_px)} px, allowed are "
                f"{_size(own.image_px)} px, as those of {own.name}"
            )
    if len(set(own.pushes)) < MIN_FRAMES:
        raise InputError(
            f"{own.name}: has {len(set(own.pushes))} pushes with contact, allowed are "
            f"{MIN_FRAMES} or more for training"
        )
    held_out, tried = np.empty_like(own.labels), [list[Floats]() for _ in foreign]
    constant = np.empty_like(own.labels)
    models = []
    for fold in range(FOLDS):
        rest = _folds(own.pushes) != fold
        model = trained(own.features[rest], own.labels[rest], own.pushes[rest])
        held_out[~rest] = model(own.features[~rest])
        constant[~rest] = own.labels[rest].mean(axis=0)
        for estimates, frames in zip(tried, foreign, strict=True):
            estimates.append(model(frames.features))
        models.append(model)
        on_fold()
    if with_predictions:
        held = dict(zip(own.pushes.tolist(), _folds(own.pushes).tolist(), strict=True))
        write_predictions(train, models, held)
        for root in others:
            write_predictions(root, models, {})
    rows = [_errors(own, LEARNED, held_out), _errors(own, CONSTANT, constant)]
    rows += _references(own)
    for estimates, frames in zip(tried, foreign, strict=True):
        mean = np.broadcast_to(own.labels.mean(axis=0), frames.labels.shape)
        rows += [_errors(frames, LEARNED, np.stack(estimates)), _errors(frames, CONSTANT, mean)]
        rows += _references(frames)
    return {
        "train": own.name,
        "training_frames": len(own.labels) * (FOLDS - 1) // FOLDS,
        "rows": [row._asdict() for row in rows],
    }


def write_predictions(root: Path, models: Sequence[Model], folds: Mapping[str, int]) -> Path:
    """Write the estimates of all frames of a dataset to its predictions/learned.csv.

    `folds` are the numbers of the models that were trained without these pushes; frames of other
    pushes get the mean of all models. Nothing of the truth is read. Returns the path. Raises
    InputError.
    """
    observations = open_observations(Layout(root).observations)
    rows = []
    for frame in observations:
        image, start = frame.image(), time.perf_counter()
        described = features(image)[None]
        fold = folds.get(frame.push_id)
        chosen = models if fold is None else [models[fold]]
        place, ln_force = np.mean([model(described)[0] for model in chosen], axis=0)
        values = {
            "x_c_m": float(place) * observations.rig.beam.length,
            "force_n": float(np.exp(ln_force)),
        }
        milliseconds = 1e3 * (time.perf_counter() - start)
        rows.append(row(frame.frame_id, Estimate(Outcome.CONTACT, values=values), milliseconds))
    path = Results(root).predictions / f"{LEARNED}.csv"
    write_results(path.parent, {path.name: csv_text(rows).encode()})
    return path


def read(root: Path) -> Frames:
    """Read features, labels and estimates of a dataset. Raises InputError."""
    truth = open_truth(Layout(root).truth)
    observations = open_observations(Layout(root).observations)
    length_mm = truth.manifest["true_rig"]["beam_length_mm"]
    table = truth.frames.select(
        "frame_id", x=pl.col("x_c_mm") / length_mm, ln_force=pl.col("force_n").log()
    ).drop_nulls()
    labels = {name: values for name, *values in table.iter_rows()}
    frames = [frame for frame in observations if frame.frame_id in labels]
    if not frames:
        raise InputError(f"{root}: holds no frame with contact")
    height, width = frames[0].image().shape
    return Frames(
        str(root),
        (width, height),
        np.array([frame.push_id for frame in frames]),
        np.array([features(frame.image()) for frame in frames]),
        np.array([labels[frame.frame_id] for frame in frames]),
        {
            method: _estimates(path, length_mm, [frame.frame_id for frame in frames])
            for method in REFERENCES
            if exists(path := Results(root).predictions / f"{method}.csv")
        },
    )


def features(image: Grey) -> Floats:
    """Describe the places of thin bright lines in an image (height, width) by one vector.

    For every column of blocks the features are the blurred distribution of squared line brightness
    over its rows.
    """
    lines = cv2.morphologyEx(image, cv2.MORPH_TOPHAT, np.ones((LINE_PX, 1), np.uint8))
    squared = lines.astype(np.float64) ** 2
    height, width = image.shape
    size = max(width // BLOCK_PX[0], 1), max(height // BLOCK_PX[1], 1)
    columns = cv2.resize(squared, (size[0], height), interpolation=cv2.INTER_AREA)
    # A kernel of width 1 does not blur along the rows; 0 is a height that follows from the sigma.
    blurred = cv2.GaussianBlur(columns, (1, 0), BLUR_PX)
    blocks = np.asarray(cv2.resize(blurred, size, interpolation=cv2.INTER_AREA), np.float64)
    # A column without any line has features of zero.
    sums = np.maximum(blocks.sum(axis=0), np.finfo(np.float64).tiny)
    return np.ravel(blocks / sums)


def trained(inputs: Floats, labels: Floats, pushes: np.ndarray) -> Model:
    """Train a model on features (n, blocks) and labels (n, 2); return its estimation of labels.

    The number of principal components, the width of the kernel and the ridge are chosen by
    cross-validation. No random number is used, and one thread: models are small.
    """
    from sklearn.decomposition import PCA
    from sklearn.kernel_ridge import KernelRidge
    from sklearn.model_selection import GridSearchCV, PredefinedSplit
    from sklearn.pipeline import make_pipeline
    from threadpoolctl import threadpool_limits  # comes with scikit-learn

    mean, sigma = labels.mean(axis=0), labels.std(axis=0)
    search = GridSearchCV(
        make_pipeline(PCA(svd_solver="full", whiten=True), KernelRidge(kernel="rbf")),
        {
            "pca__n_components": [10, 20, 40],
            "kernelridge__gamma": [1e-3, 3e-3, 1e-2, 3e-2],
            "kernelridge__alpha": [1e-4, 1e-2, 1e-1],
        },
        scoring="neg_mean_squared_error",
        cv=PredefinedSplit(_folds(pushes)),
    )
    with threadpool_limits(1):
        search.fit(inputs, (labels - mean) / sigma)

    def model(tried: Floats) -> Floats:
        estimates: Floats = mean + sigma * search.predict(tried)
        return estimates

    return model


def markdown(record: dict[str, Any]) -> str:
    """Format the record of `measure` as a Markdown table under a heading sentence."""
    table = markdown_table(HEADS, cells(record), (0, 1))
    return f"Trained on {record['training_frames']} frames of {record['train']}:\n\n{table}\n"


def cells(record: dict[str, Any]) -> list[tuple[str, ...]]:
    """Format one line of text per estimator and dataset: those of `markdown`."""
    return [
        (
            f"{row['dataset']}{' (held out)' if row['dataset'] == record['train'] else ''}",
            row["estimator"],
            f"{row['answered']} of {row['estimates']}",
            *(
                "–" if value is None else f"{value:.2g}"
                for value in (row["x_c_rmse_pct_L"], row["force_rms_ln"])
            ),
        )
        for row in record["rows"]
    ]


def _require_sklearn() -> None:
    try:
        import sklearn  # noqa: F401
    except ImportError as error:
        raise InputError(
            "scikit-learn is missing; install the extra: uv pip install '.[learned]'"
        ) from error


def _folds(pushes: np.ndarray) -> np.ndarray:
    """Number the fold of each frame; frames of one push share it."""
    return np.asarray(np.unique(pushes, return_inverse=True)[1] % FOLDS)


def _estimates(path: Path, length_mm: float, frame_ids: Sequence[str]) -> Floats:
    """Read the labels (n, 2) that a method has estimated, NaN for frames without an answer."""
    table = read_predictions(path).filter(pl.col("force_n") > 0)
    rows = table.select("frame_id", pl.col("x_c_mm") / length_mm, pl.col("force_n").log())
    values = {name: labels for name, *labels in rows.drop_nulls().iter_rows()}
    return np.array([values.get(name, (np.nan, np.nan)) for name in frame_ids])


def _references(frames: Frames) -> list[Errors]:
    return [_errors(frames, method, labels) for method, labels in frames.estimates.items()]


def _errors(frames: Frames, estimator: str, estimates: Floats) -> Errors:
    """Compute the errors of estimates (..., n, 2), NaN where there is none."""
    errors = (estimates - frames.labels).reshape(-1, 2)
    known = errors[~np.isnan(errors).any(axis=1)]
    x_c, force = (RMS.of(one) if len(known) else None for one in known.T)
    return Errors(
        frames.name,
        estimator,
        len(errors),
        len(known),
        None if x_c is None else 100 * x_c,
        force,
    )


def _size(image_px: tuple[int, int]) -> str:
    return f"{image_px[0]} x {image_px[1]}"
