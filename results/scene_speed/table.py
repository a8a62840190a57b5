"""Table of what scenes cost, with their ratios to the paper's rig and the targets."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from statistics import median
from typing import Any, Final

import polars as pl

from vbaa_bench.scoring.tables import markdown_table

# Scene to whose frame all others are compared.
REFERENCE: Final = "fig8_rigid"
# Targets: the median and the largest ratio of a frame's cost to that of the reference, and the
# seconds of all calibration views.
MEDIAN_RATIO, LARGEST_RATIO, BOARDS_S = 3.0, 8.0, 2.0

Record = dict[str, Any]


@dataclass(frozen=True)
class SceneSpeed:
    """Costs of one scene, named as in `scene_cost`; None if not measured, for a `reason`.

    `ratio` is the cost of a frame over that of the reference.
    """

    scene: str
    width_px: int | None = None
    height_px: int | None = None
    plan_s: float | None = None
    table_s: float | None = None
    static_s: float | None = None
    boards_s: float | None = None
    frame_s: float | None = None
    mechanics_s: float | None = None
    mesh_s: float | None = None
    render_s: float | None = None
    sensor_s: float | None = None
    files_s: float | None = None
    samples: int | None = None
    noise_over_target: float | None = None
    ratio: float | None = None
    reason: str | None = None

    @property
    def frame_passes(self) -> bool | None:
        """Return whether a frame's cost is within the target; None if unknown."""
        return None if self.ratio is None else self.ratio <= LARGEST_RATIO

    @property
    def boards_pass(self) -> bool | None:
        """Return whether the calibration views are within the target; None if unknown."""
        return None if self.boards_s is None else self.boards_s <= BOARDS_S

    def record(self) -> Record:
        """Return all values by name."""
        passes = {"frame_passes": self.frame_passes, "boards_pass": self.boards_pass}
        return asdict(self) | passes


def compared(speeds: Sequence[SceneSpeed]) -> list[SceneSpeed]:
    """Compute ratios to the first scene named as the reference; sort by cost, largest first."""
    frames = (speed.frame_s for speed in speeds if Path(speed.scene).name == REFERENCE)
    reference = next(frames, None)
    if reference is not None:
        speeds = [
            replace(speed, ratio=None if speed.frame_s is None else speed.frame_s / reference)
            for speed in speeds
        ]
    # Frames that could not be measured come first: most of them take too long.
    return sorted(speeds, key=lambda s: math.inf if s.frame_s is None else s.frame_s, reverse=True)


def summary(speeds: Sequence[SceneSpeed]) -> Record:
    """Summarise all scenes: median and largest ratio, and the numbers of scenes within targets."""
    ratios = [speed.ratio for speed in speeds if speed.ratio is not None]
    return {
        "scenes": len(speeds),
        "incomplete": sum(speed.reason is not None for speed in speeds),
        "median_ratio": median(ratios) if ratios else None,
        "largest_ratio": max(ratios, default=None),
        "frames_pass": sum(speed.frame_passes is True for speed in speeds),
        "boards_pass": sum(speed.boards_pass is True for speed in speeds),
    }


def sentence(speeds: Sequence[SceneSpeed]) -> str:
    """State the summary beside its targets."""
    record, parts = summary(speeds), list[str]()
    count, middle, largest = record["scenes"], record["median_ratio"], record["largest_ratio"]
    if middle is not None:
        parts = [
            f"median ratio to {REFERENCE} {middle:.2f} (at most {MEDIAN_RATIO:g}: "
            f"{_yes(middle <= MEDIAN_RATIO)})",
            # A frame that could not be measured may cost more than all others.
            f"largest ratio {largest:.2f} (at most {LARGEST_RATIO:g} in every scene: "
            f"{_yes(record['frames_pass'] == count)})",
        ]
    parts.append(
        f"boards within {BOARDS_S:g} s in {record['boards_pass']} of {count} scenes "
        f"(every scene: {_yes(record['boards_pass'] == count)})"
    )
    if record["incomplete"]:
        parts.append(f"{record['incomplete']} of {count} scenes could not be measured completely")
    return "; ".join(parts)


def cells(speeds: Sequence[SceneSpeed]) -> tuple[list[str], list[list[str]]]:
    """Format all scenes as heads and rows of a table; without a reference there are no ratios."""
    columns = [_columns(speed) for speed in speeds]
    heads = list(columns[0])
    if all(speed.ratio is None for speed in speeds):
        heads = [head for head in heads if head not in _OF_RATIOS]
    return heads, [[row[head] for head in heads] for row in columns]


_OF_RATIOS: Final = ("ratio", f"ratio <= {LARGEST_RATIO:g}")


def _columns(speed: SceneSpeed) -> dict[str, str]:
    size = None if speed.width_px is None else f"{speed.width_px} x {speed.height_px}"
    millions = None if speed.samples is None else speed.samples / 1e6
    ratio, ratio_passes = _OF_RATIOS
    return {
        "scene": speed.scene,
        "image, px": size or "–",
        "plan, per push": _number(speed.plan_s),
        "table": _number(speed.table_s),
        "static layer": _number(speed.static_s),
        "boards": _number(speed.boards_s),
        "frame": _number(speed.frame_s),
        "mechanics": _number(speed.mechanics_s),
        "mesh": _number(speed.mesh_s),
        "render": _number(speed.render_s),
        "sensor": _number(speed.sensor_s),
        "files": _number(speed.files_s),
        "samples, 1e6": _number(millions),
        "noise / target": _number(speed.noise_over_target),
        ratio: _number(speed.ratio),
        ratio_passes: _yes(speed.frame_passes),
        f"boards <= {BOARDS_S:g}": _yes(speed.boards_pass),
    }


def markdown(speeds: Sequence[SceneSpeed]) -> str:
    """Format all scenes as a Markdown table, with the reasons of failures."""
    heads, rows = cells(speeds)
    lines = ([*row, speed.reason or ""] for row, speed in zip(rows, speeds, strict=True))
    table = markdown_table([*heads, "reason"], lines, (0, len(heads)))
    return f"Seconds on one core.\n\n{table}\n\n{sentence(speeds)}.\n"


def csv(speeds: Sequence[SceneSpeed]) -> str:
    """Format all scenes as CSV, with all values."""
    schema = [*(field.name for field in fields(SceneSpeed)), "frame_passes", "boards_pass"]
    records = [speed.record() for speed in speeds]
    return pl.DataFrame(records, schema=schema, infer_schema_length=None).write_csv()


def _number(value: float | None) -> str:
    return "–" if value is None else f"{float(f'{round(value, 4):.3g}'):g}"


def _yes(passes: bool | None) -> str:
    return "–" if passes is None else "yes" if passes else "no"
