"""Frames of a dataset for training: a map-style dataset, with PyTorch if it is installed."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vbaa_bench.dataset.frame_index import index_frames
from vbaa_bench.dataset.frame_records import FrameRecords, Transform, frame_records
from vbaa_bench.dataset.labels import USUAL_LABELS

if TYPE_CHECKING:
    from vbaa_bench.api.data import Collection, Dataset


def torch_dataset(
    data: "Path | str | Dataset | Collection",
    split: str | None = "train",
    *,
    labels: Sequence[str] = USUAL_LABELS,
    raw: bool = False,
    transform: Transform | None = None,
    check: bool = True,
) -> FrameRecords:
    """Open the frames of a dataset or collection for training, as a `torch.utils.data.Dataset`.

    A record, `dataset[i]`, is a dict: `image` (1, h, w), 32-bit floats from 0 to 1, which is a
    saturated pixel; `labels` and `readings`, dicts of numbers by the column of truth.parquet and of
    metadata.csv (see the data dictionary), NaN where they are null; `frame_id`, `push_id`, `step`
    and `rig`, the rig's number in a collection. A method may use `image` and `readings` only.

    `split` is one of the scene's `splits`, "train" if it has none, or None for all frames. `labels`
    are columns of numbers of truth.parquet, and `contact` and `compliance_mm_per_n`; lists become
    arrays. With `raw`, images are 8 or 16-bit integers as stored. `transform` is called with every
    record, and its result returned. With `check`, all files are compared with their hashes.

    Without PyTorch, images and labels are NumPy arrays. Raises InputError if the folder is no
    complete dataset or does not have the split or a label; `dataset[i]` does for a damaged image.
    """
    root = Path(data) if isinstance(data, Path | str) else Path(data.root)
    return frame_records(index_frames(root, split, labels, check=check), raw, transform)
