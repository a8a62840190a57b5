"""Opening the truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from vbaa_bench.dataset.manifest import read_json


@dataclass(frozen=True)
class Truth:
    """An opened truth tree: the manifest and one row a frame, sorted by frame id."""

    root: Path
    manifest: dict[str, Any]
    frames: pl.DataFrame

    @property
    def camera(self) -> Camera:
        """The true camera, with which the frames were rendered."""
        found = self.manifest["true_rig"]["camera"]
        return Camera(
            width=found["width_px"],
            height=found["height_px"],
            fx=found["fx_px"],
            fy=found["fy_px"],
            cx=found["cx_px"],
            cy=found["cy_px"],
            camera_from_antenna=np.array(found["camera_from_antenna"]),
            telecentric=found["telecentric"],
            distortion=tuple(found["distortion"]),
        )


def open_truth(root: Path) -> Truth:
    """Open the truth tree at `root`. Raises InputError if it is missing, broken or incomplete."""
    if not (root / "manifest.json").is_file():
        raise InputError(f"{root}: has no manifest.json, so it is no complete truth tree")
    manifest = read_json(root / "manifest.json")
    tables = sorted(root.glob("shard_*/truth.parquet"))
    if not tables:
        raise InputError(f"{root}: holds no shard_*/truth.parquet")
    try:
        # Relaxed: a column that is null in a whole shard has no type there.
        shards = [pl.read_parquet(table) for table in tables]
        frames = pl.concat(shards, how="vertical_relaxed").sort("frame_id")
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{root}: a truth.parquet cannot be read ({error})") from error
    return Truth(root, manifest, frames)
