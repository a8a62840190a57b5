"""Combine the statistics of a LeRobot export's episodes with LeRobot's own function."""

from pathlib import Path
from typing import Any

import numpy as np

from tests.robustness.export_clients.clients.check import Check


def statistics(folder: Path) -> Check:
    """Combine the statistics of the episodes with LeRobot's own function."""
    import pyarrow.parquet as pq
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.utils import load_stats

    episodes: list[dict[str, dict[str, Any]]] = []
    for file in sorted(folder.glob("meta/episodes/*/*.parquet")):
        for row in pq.read_table(file).to_pylist():
            stats: dict[str, dict[str, Any]] = {}
            for name, value in row.items():
                if name.startswith("stats/"):
                    _, feature, key = name.split("/")
                    stats.setdefault(feature, {})[key] = np.array(value)
            episodes.append(stats)
    stated = load_stats(folder)
    # Without values a feature has count 0, for which LeRobot divides by zero.
    used = [name for name in stated if stated[name]["count"][0] > 0]
    kept = [{name: stats[name] for name in used} for stats in episodes]
    combined = aggregate_stats(kept)
    worst = max(
        float(np.max(np.abs(combined[name][key] - stated[name][key]) / _scale(stated[name][key])))
        for name in used
        for key in ("min", "max", "mean", "std", "count", "q50")
        if all(stats[name]["count"][0] > 0 for stats in kept)
    )
    asked = "statistics combined by LeRobot, relative difference"
    return Check(asked, "below 1e-9", f"{worst:.1g}", worst < 1e-9)


def _scale(values: Any) -> float:
    return float(max(np.max(np.abs(values)), 1e-3))
