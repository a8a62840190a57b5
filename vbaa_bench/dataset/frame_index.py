"""Index of the frames of a dataset or a collection, in compact arrays."""

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.errors import DamageError, InputError, truncated
from solver.instrument.files import open_regular
from solver.instrument.hashes import MEND, read_bytes, read_hashes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.labels import check_labels, label_columns, select_labels, to_array
from vbaa_bench.dataset.layout import METADATA, TRUTH_TABLE, Layout, shard_numbers
from vbaa_bench.dataset.readers import open_manifest
from vbaa_bench.dataset.splits import check_split, split_names

# Columns of metadata.csv that are no readings.
_NO_READINGS: Final = {"file_name", "frame_id", "push_id", "step", "split"}


class Shard(NamedTuple):
    """Folder of a shard's images, number of its rig, and gray value of a saturated pixel."""

    folder: str
    rig: int
    full_scale: int


@dataclass(frozen=True, eq=False)
class FrameIndex:
    """Frames of a dataset or a collection, in the order of rigs, shards and metadata.csv.

    All arrays have a row per frame: the number of its shard in `shards`, its ids as bytes, its step
    in the push, the sha256 of its image (n, 32), empty without a check, and the columns of `labels`
    and `readings`, (n,) or (n, m).
    """

    shards: tuple[Shard, ...]
    shard: np.ndarray
    frame_id: np.ndarray
    push_id: np.ndarray
    step: np.ndarray
    sha256: np.ndarray
    labels: Mapping[str, np.ndarray]
    readings: Mapping[str, np.ndarray]


class _Part(NamedTuple):
    """A shard's frames in the requested split, and all its splits and possible labels."""

    shard: Shard
    step: np.ndarray
    frame_id: np.ndarray
    push_id: np.ndarray
    sha256: np.ndarray
    labels: pl.DataFrame
    readings: pl.DataFrame
    splits: frozenset[str]
    possible_labels: frozenset[str]


def index_frames(
    root: Path, split: str | None, labels: Sequence[str], *, check: bool = True
) -> FrameIndex:
    """Index the frames of a split, or of all splits if it is None.

    `root` is a complete dataset or a collection, of which the complete rigs are indexed. `labels`
    are columns of the truth, see `label_columns`; those that a rig does not have are NaN. With
    `check`, tables are compared with their hashes. Raises InputError if the folder is no complete
    dataset, is damaged, or does not have the split or a label.
    """
    layouts = CollectionLayout(root).rigs() if is_collection(root) else {0: Layout(root)}
    parts = [
        _part(shard, layout, labels, split, check)
        for rig, layout in layouts.items()
        for shard in _shards(rig, layout)
    ]
    if split is not None:
        check_split(split, frozenset[str]().union(*(part.splits for part in parts)), root)
    if not parts:
        raise InputError(f"{root}: has no frames")
    check_labels(labels, frozenset[str]().union(*(part.possible_labels for part in parts)), root)
    columns, readings = (
        pl.concat(tables, how="diagonal_relaxed")
        for tables in ([part.labels for part in parts], [part.readings for part in parts])
    )
    return FrameIndex(
        shards=tuple(part.shard for part in parts),
        shard=np.repeat(
            np.arange(len(parts), dtype=np.int32), [len(part.frame_id) for part in parts]
        ),
        frame_id=np.concatenate([part.frame_id for part in parts]),
        push_id=np.concatenate([part.push_id for part in parts]),
        step=np.concatenate([part.step for part in parts]),
        sha256=np.concatenate([part.sha256 for part in parts]),
        labels={name: to_array(columns[name], root) for name in labels},
        readings={name: to_array(readings[name], root) for name in readings.columns},
    )


def _shards(rig: int, layout: Layout) -> Iterator[Shard]:
    """List the shards of a dataset, which are those in its hashes.json."""
    scene = open_manifest(layout.truth).manifest["scene"]
    try:
        full_scale = 2 ** int(scene["sensor"]["bits"]) - 1
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{layout.manifest}: the key scene.sensor.bits is missing") from error
    for number in shard_numbers(read_hashes(layout.observations) or ()):
        yield Shard(str(layout.shard(layout.observations, number)), rig, full_scale)


def _part(
    shard: Shard, layout: Layout, labels: Sequence[str], split: str | None, check: bool
) -> _Part:
    """Read the tables of a shard, and join them by frame_id."""
    folder = Path(shard.folder)
    truth_file = layout.truth / folder.name / TRUTH_TABLE

    def source(path: Path) -> Path | io.BytesIO:
        if check:
            return io.BytesIO(read_bytes(path))
        open_regular(path).close()
        return path

    try:
        metadata = pl.read_csv(source(folder / METADATA), infer_schema=False)
        truth = pl.scan_parquet(source(truth_file))
        schema = truth.collect_schema()
        truth_ids = truth.select("frame_id").collect()["frame_id"]
        if not metadata["frame_id"].sort().equals(truth_ids.sort()):
            raise InputError(f"{folder}: metadata.csv and {truth_file} list different frames")
        splits = split_names(metadata)
        chosen = metadata if split is None else metadata.filter(splits == split)
        readings = [name for name in metadata.columns if name not in _NO_READINGS]
        return _Part(
            shard=shard,
            step=chosen["step"].cast(pl.Int32).to_numpy(),
            frame_id=_ids(folder, chosen["frame_id"]),
            push_id=_ids(folder, chosen["push_id"]),
            sha256=_digests(folder, chosen["frame_id"] if check else ()),
            labels=chosen.select("frame_id")
            .join(select_labels(truth, labels).collect(), on="frame_id", maintain_order="left")
            .drop("frame_id"),
            readings=chosen.select(pl.col(readings).cast(pl.Float32)),
            splits=frozenset(splits),
            possible_labels=frozenset(label_columns(schema)),
        )
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(
            f"{folder}: its tables cannot be read ({truncated(str(error))})"
        ) from error


def _ids(folder: Path, names: pl.Series) -> np.ndarray:
    """Convert names to an array of bytes, of fixed length. Raises InputError for a path."""
    if names.str.contains(r"[/\\\x00]").any():
        raise InputError(f"{folder / METADATA}: has a frame_id or push_id that is a path")
    return np.array([name.encode() for name in names], dtype="S")


def _digests(folder: Path, frame_ids: Sequence[str] | pl.Series) -> np.ndarray:
    """Look up the sha256 (n, 32) of images. Raises DamageError if one is not listed."""
    table, digests = read_hashes(folder) or {}, bytearray()
    for frame_id in frame_ids:
        try:
            digests += bytes.fromhex(table[f"{frame_id}.png"])
        except (KeyError, ValueError) as error:
            raise DamageError(
                f"{folder}: hashes.json has no sha256 of {frame_id}.png; {MEND}"
            ) from error
    return np.frombuffer(bytes(digests), np.uint8).reshape(-1, 32)
