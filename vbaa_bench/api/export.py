"""Copies of datasets: for other tools, and of some of the frames."""

from collections.abc import Callable
from pathlib import Path

from solver.instrument.errors import InputError
from vbaa_bench.api.data import AnyDataset, Dataset, dataset_folder
from vbaa_bench.dataset.subset import Choice
from vbaa_bench.dataset.subset import subset as write_subset
from vbaa_bench.exports import croissant
from vbaa_bench.exports.export import Export
from vbaa_bench.exports.export import export as export_dataset


def export(
    data: AnyDataset,
    to: str,
    out: Path | str,
    *,
    centrelines: bool = False,
    progress: Callable[[str, int, int], None] = lambda _step, _done, _total: None,
) -> Export:
    """Export a dataset or a collection to the new folder `out`, and check it by reading it back.

    `to` is a format, "hf", "webdataset", "lerobot" or "csv", or "package.module:Class" of your own.
    With `centrelines` they are exported too, 15 kB per frame. `progress` is called with the step
    (reading, writing, checking), what is done of it, and all of it. An interrupted export continues
    at the next call. Raises InputError.

    >>> vb.export(data, "csv", "runs/as_csv").splits
    {'train': 4}
    """
    return export_dataset(dataset_folder(data), to, Path(out), progress, centrelines=centrelines)


def write_croissant(data: AnyDataset) -> Path:
    """Write Croissant metadata into the folder of a dataset or collection; return their file.

    Raises InputError.

    >>> vb.write_croissant(data).name
    'croissant.json'
    """
    return croissant.write_croissant(dataset_folder(data))


def subset(
    data: AnyDataset,
    out: Path | str,
    *,
    frames: int | None = None,
    split: str | None = None,
    shards: tuple[int, int] | None = None,
    cut_pushes: bool = False,
) -> Dataset:
    """Copy some frames of a dataset into the new dataset `out`, which is solved as any other.

    State one of `frames`, the largest number of frames, of whole pushes; `split`, the name of a
    split; and `shards`, the first and the one after the last, whose pushes may be cut. With
    `cut_pushes`, exactly `frames` frames are copied. Raises InputError.

    >>> few = vb.subset(data, "runs/few", frames=2)
    >>> few.truth.frames.height
    2
    """
    if sum(value is not None for value in (frames, split, shards)) != 1:
        raise InputError("allowed is one of frames, split and shards")
    if cut_pushes and frames is None:
        raise InputError("cut_pushes is allowed with frames only")
    write_subset(dataset_folder(data), Path(out), Choice(frames, split, shards, cut_pushes))
    return Dataset(Path(out))
