"""Statistics of LeRobot's features: per episode, and combined for all episodes.

They are what LeRobot's `compute_stats.py` (0.4.4) defines: min, max, mean, std, count and five
quantiles; images in [0, 1] with the shape (3, 1, 1). Combined quantiles are, as there, the means of
those of the episodes, weighted by count. Quantiles of an episode are exact, not of a histogram.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Grey

QUANTILES: Final = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
# Statistics of one feature: "count" with one number, the others with a number per value.
Stats = dict[str, Floats]


def value_stats(values: npt.NDArray[Any]) -> Stats:
    """Compute the statistics of values (n, k) of an episode, without NaN; zero if there are none.

    `count` is the number of frames that have a value.
    """
    rows = values[~np.isnan(values).any(axis=1)].astype(np.float64)
    count = np.array([len(rows)])
    rows = rows if len(rows) else np.zeros((1, values.shape[1]))
    quantiles = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": count,
        **dict(zip(QUANTILES, quantiles, strict=True)),
    }


def image_stats(images: Sequence[Grey]) -> Stats:
    """Compute the statistics of the 8-bit images of an episode, in three equal channels."""
    histogram = sum(np.bincount(image.ravel(), minlength=256) for image in images)
    counts, grays = np.asarray(histogram), np.arange(256) / 255
    total, used = counts.sum(), grays[np.asarray(histogram) > 0]
    mean = counts @ grays / total
    below = np.cumsum(counts)
    values = {
        "min": used[0],
        "max": used[-1],
        "mean": mean,
        "std": np.sqrt(counts @ (grays - mean) ** 2 / total),
        **{name: grays[np.searchsorted(below, share * total)] for name, share in QUANTILES.items()},
    }
    stats = {name: np.full((3, 1, 1), value) for name, value in values.items()}
    return {**stats, "count": np.array([len(images)])}


def combined(parts: Sequence[Stats]) -> Stats:
    """Combine the statistics of a feature, weighted by count. Parts without values are left out."""
    filled = [stats for stats in parts if stats["count"][0]] or list(parts[:1])
    counts = np.array([max(stats["count"][0], 1) for stats in filled], dtype=np.float64)

    def weighted(values: Sequence[Floats]) -> Floats:
        return np.asarray(np.tensordot(counts / counts.sum(), np.stack(values), axes=1))

    mean = weighted([stats["mean"] for stats in filled])
    variance = weighted([stats["std"] ** 2 + (stats["mean"] - mean) ** 2 for stats in filled])
    return {
        "min": np.min([stats["min"] for stats in filled], axis=0),
        "max": np.max([stats["max"] for stats in filled], axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": np.array([sum(stats["count"][0] for stats in parts)]),
        **{name: weighted([stats[name] for stats in filled]) for name in QUANTILES},
    }
