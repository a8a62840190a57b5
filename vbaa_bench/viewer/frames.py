"""Frames to be viewed: image, truth and estimates, push by push."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError, quoted
from solver.instrument.images import read_grey
from solver.instrument.units import DEGREE
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.frame_index import FrameIndex, index_frames
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_manifest, read_rows
from vbaa_bench.scoring.camera_frame import camera_frame_from_clamp
from vbaa_bench.scoring.overlay import Overlay, overlay_of
from vbaa_bench.scoring.predictions import read_predictions
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import found_predictions

Row = Mapping[str, Any]


@dataclass(frozen=True)
class ViewedFrame:
    """A frame: its number and that of its push, in the order of the scene's pushes.

    `row` is its row of truth.parquet, `estimates` are the rows of predictions by method.
    """

    number: int
    push: int
    image: Grey
    row: Row
    estimates: Mapping[str, Row]
    truth: Truth

    @cached_property
    def overlay(self) -> Overlay:
        """The image with the truth and the estimated contacts, to be drawn."""
        distances = {
            method: row["x_c_mm"]
            for method, row in self.estimates.items()
            if row["x_c_mm"] is not None
        }
        return overlay_of(self.truth, self.row, self.image, distances)

    @cached_property
    def frame_from_clamp(self) -> Floats:
        """Transform (4, 4) from the clamp's frame to that in which the camera is fixed."""
        return camera_frame_from_clamp(self.truth, self.row["true_motor_angle_deg"] * DEGREE)

    @property
    def title(self) -> str:
        """Push, step, and the truth in words."""
        return f"push {self.push}, step {self.row['step']}: {self.overlay.title}"


@dataclass(frozen=True)
class ViewedDataset:
    """A dataset with chosen frames, in the order of the scene's pushes, and its methods.

    `chosen` (n,) are indices of frames in `index`, `numbers` and `pushes` (n,) count frames and
    pushes in that order. `predictions` are tables by method, of these frames only.
    """

    truth: Truth
    index: FrameIndex
    chosen: np.ndarray
    numbers: np.ndarray
    pushes: np.ndarray
    predictions: Mapping[str, pl.DataFrame]

    @property
    def trials(self) -> list[int]:
        """Numbers of the frames in the scene's list of pushes."""
        return [int(trial) for trial in self.index.labels["trial"][self.chosen]]

    def __len__(self) -> int:
        return len(self.chosen)

    @cached_property
    def _rows(self) -> dict[str, dict[str, Any]]:
        """Rows of the truth, with centrelines, by frame_id; each shard is read once."""
        rows: dict[str, dict[str, Any]] = {}
        for shard in np.unique(self.index.shard[self.chosen]):
            names = self._names(self.chosen[self.index.shard[self.chosen] == shard])
            folder = self.truth.root / Path(self.index.shards[shard].folder).name
            rows |= {row["frame_id"]: row for row in read_rows(folder, names)}
        return rows

    @cached_property
    def _estimates(self) -> dict[str, dict[str, Row]]:
        """Estimates by frame_id and method."""
        estimates: dict[str, dict[str, Row]] = {}
        for method, table in self.predictions.items():
            for row in table.to_dicts():
                estimates.setdefault(row["frame_id"], {})[method] = row
        return estimates

    def __iter__(self) -> Iterator[ViewedFrame]:
        """Iterate over the chosen frames. Raises InputError for an image that is damaged."""
        for i, number, push in zip(self.chosen, self.numbers, self.pushes, strict=True):
            (name,) = self._names(np.array([i]))
            path = Path(self.index.shards[self.index.shard[i]].folder) / f"{name}.png"
            yield ViewedFrame(
                int(number),
                int(push),
                read_grey(path),
                self._rows[name],
                self._estimates.get(name, {}),
                self.truth,
            )

    def _names(self, indices: np.ndarray) -> list[str]:
        return [name.decode() for name in self.index.frame_id[indices]]


def open_frames(root: Path, frames: slice, pushes: Sequence[str] = ()) -> ViewedDataset:
    """Open the frames of a dataset to be viewed.

    `frames` selects from all frames in the order of the scene's pushes, or from those of `pushes`
    (push_id), if any. Raises InputError if nothing is selected, for a collection, and for a dataset
    that is incomplete or damaged.
    """
    if is_collection(root):
        rigs = ", ".join(str(rig.root) for rig in CollectionLayout(root).rigs().values())
        raise InputError(f"{root}: is a collection; view one of its datasets: {rigs or 'none yet'}")
    layout = Layout(root)
    index = index_frames(root, None, ("trial",))
    order = np.argsort(index.labels["trial"], kind="stable")
    _, first, push_of = np.unique(index.push_id[order], return_index=True, return_inverse=True)
    # Pushes are counted in the order of their first frames.
    push_numbers = np.argsort(np.argsort(first))[push_of]
    selected = np.arange(len(order))
    if pushes:
        names = [name.encode() for name in pushes]
        for name in names:
            if name not in index.push_id:
                raise InputError(f"{root}: the push {quoted(name.decode())} does not exist")
        selected = selected[np.isin(index.push_id[order], names)]
    numbers = selected[frames]
    if not len(numbers):
        raise InputError(
            f"{root}: no frame is selected, allowed is a range within 0:{len(selected)}"
        )
    chosen = order[numbers]
    ids = [name.decode() for name in index.frame_id[chosen]]
    tables = {
        method: read_predictions(path).filter(pl.col("frame_id").is_in(ids))
        for method, path in found_predictions(Results(root)).items()
    }
    return ViewedDataset(
        truth=open_manifest(layout.truth),
        index=index,
        chosen=chosen,
        numbers=numbers,
        pushes=push_numbers[numbers],
        predictions={name: table for name, table in tables.items() if table.height},
    )
