"""Opening the truth, and checking that a dataset is what it was."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import hashes


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
        )


def open_truth(root: Path) -> Truth:
    """Open the truth tree at `root`. Raises InputError if it is missing, broken or incomplete."""
    try:
        manifest = json.loads((root / "manifest.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{root}: has no readable manifest.json, so it is no complete truth tree"
        ) from error
    except ValueError as error:
        raise InputError(f"{root / 'manifest.json'}: is not JSON ({error})") from error
    tables = sorted(root.glob("shard_*/truth.parquet"))
    if not tables:
        raise InputError(f"{root}: holds no shard_*/truth.parquet")
    try:
        frames = pl.concat([pl.read_parquet(table) for table in tables]).sort("frame_id")
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{root}: a truth.parquet cannot be read ({error})") from error
    return Truth(root, manifest, frames)


def verify(layout: Layout) -> None:
    """Compare every file with its hash. Raises InputError naming the first that differs."""
    recorded = {
        layout.observations: json.loads(layout.hashes.read_text(encoding="utf-8")),
        layout.truth: json.loads(layout.manifest.read_text(encoding="utf-8"))["hashes"],
    }
    for tree, expected in recorded.items():
        found = hashes(tree)
        for name, digest in expected.items():
            if found.get(name) != digest:
                state = "missing" if name not in found else "not what was generated"
                raise InputError(f"{tree / name}: is {state}; generate the dataset again")
