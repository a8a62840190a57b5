"""A subset of a dataset as a dataset of its own: some shards, or whole pushes of a number or split.

Its manifest and identity have the key `subset`: the choice, the number of frames and the sha256 of
the truth/hashes.json of its source. It can be solved and scored, but not generated or grown.
"""

import csv
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import HASHES, MEND, digest, hashes_bytes, read_bytes, read_hashes
from vbaa_bench.dataset.collection import is_collection
from vbaa_bench.dataset.copies import complete_table, new_folder, seal_copy
from vbaa_bench.dataset.derived import read_limits, write_limits
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.format_version import SCHEMA, version_of
from vbaa_bench.dataset.layout import FAILURES, METADATA, TRUTH_TABLE, Layout, shard_numbers
from vbaa_bench.dataset.lock import locked
from vbaa_bench.dataset.manifest import manifest_bytes
from vbaa_bench.dataset.readers import check_complete
from vbaa_bench.dataset.splits import read_splits
from vbaa_bench.dataset.tables import read_parquet


class Choice(NamedTuple):
    """Which frames: exactly one of `frames`, `split` and `shards` (first, end) is stated.

    Of `frames`, the first whole pushes with at most this number are taken, at least one; with
    `cut_pushes`, exactly this number of frames.
    """

    frames: int | None = None
    split: str | None = None
    shards: tuple[int, int] | None = None
    cut_pushes: bool = False

    def record(self) -> dict[str, Any]:
        """Return the choice as an object for JSON."""
        if self.frames is not None:
            return {"choice": "frames", "largest": self.frames, "cut_pushes": self.cut_pushes}
        if self.split is not None:
            return {"choice": "split", "split": self.split}
        return {"choice": "shards", "shards": self.shards}


class Frames(NamedTuple):
    """Chosen frames of a shard, by id, and whether these are all of its frames."""

    names: frozenset[str]
    whole: bool


def subset(source: Path, out: Path, choice: Choice) -> int:
    """Write a subset of the dataset `source` into the new folder `out`; return its frames.

    Files are compared with their hashes as they are copied. Information limits are included.
    Raises InputError if the source is damaged, the choice is empty, or `out` is not empty or
    cannot be written.
    """
    if is_collection(source):
        raise InputError(f"{source}: is a collection; choose the folder of one of its rigs")
    small, large = Layout(out), Layout(source)
    check_complete(large)
    version = version_of(large.manifest, read_json(large.manifest))
    if version != SCHEMA:
        raise InputError(
            f"{source}: has version {version} of the format, a subset can be made of version "
            f"{SCHEMA}; generate the dataset again"
        )
    chosen = _chosen(large, choice)
    with new_folder(out):
        out.mkdir(parents=True, exist_ok=True)
        with locked(small.lock):
            _write(large, small, chosen, choice)
    limits = read_limits(large)
    if limits is not None:
        names = {name for frames in chosen.values() for name in frames.names}
        write_limits(small, limits.filter(pl.col("frame_id").is_in(names)))
    return sum(len(frames.names) for frames in chosen.values())


def _chosen(layout: Layout, choice: Choice) -> dict[int, Frames]:
    """Return the chosen frames by shard. Raises InputError if there are none."""
    numbers = shard_numbers(complete_table(layout.truth))
    parts = []
    for number in numbers:
        path = layout.shard(layout.truth, number) / TRUTH_TABLE
        table = read_parquet(path, read_bytes(path), {"frame_id", "push_id"}.__contains__)
        parts.append(table.with_columns(shard=pl.lit(number)))
    frames = pl.concat(parts, how="diagonal_relaxed")
    sizes = dict(frames.group_by("shard").len().iter_rows())
    if choice.shards is not None:
        first, end = choice.shards
        frames = frames.filter(pl.col("shard").is_between(first, end - 1))
    elif choice.split is not None:
        splits = pl.concat([read_splits(layout, number) for number in numbers])
        names = sorted(splits["split"].unique())
        if choice.split not in names:
            raise InputError(f"--split is {choice.split}, allowed is one of {', '.join(names)}")
        chosen = splits.filter(split=choice.split)
        frames = frames.join(chosen, on="frame_id", how="semi", maintain_order="left")
    elif choice.frames is not None:
        frames = frames.head(choice.frames) if choice.cut_pushes else _pushes(frames, choice.frames)
    if frames.is_empty():
        raise InputError(f"{layout.root}: has no such frames, there are {len(numbers)} shards")
    by_shard = frames.group_by("shard", maintain_order=True).agg("frame_id")
    return {
        number: Frames(frozenset(names), len(names) == sizes[number])
        for number, names in by_shard.iter_rows()
    }


def _pushes(frames: pl.DataFrame, count: int) -> pl.DataFrame:
    """Select the first pushes, in the order of the files, with at most `count` frames in all."""
    pushes = frames.group_by("push_id", maintain_order=True).agg(size=pl.len())
    fits = (pushes["size"].cum_sum() <= count).to_list()
    kept = pushes["push_id"].head(max(sum(fits), 1))
    return frames.filter(pl.col("push_id").is_in(kept.to_list()))


def _write(large: Layout, small: Layout, chosen: Mapping[int, Frames], choice: Choice) -> None:
    """Write both trees. Raises OSError, InputError."""
    record = {
        **choice.record(),
        "frames": sum(len(frames.names) for frames in chosen.values()),
        "of": digest(read_bytes(large.truth / HASHES)),
    }
    tables: dict[str, dict[str, str]] = {tree.name: {} for tree in large.trees}
    failed = 0
    for number, frames in chosen.items():
        for source, target in zip(large.trees, small.trees, strict=True):
            folder = small.shard(target, number)
            folder.mkdir(parents=True)
            hashes = {}
            for name, data in _shard_files(large.shard(source, number), frames):
                (folder / name).write_bytes(data)
                hashes[name] = digest(data)
                failed += len(json.loads(data)) if name == FAILURES else 0
            table = hashes_bytes(hashes)
            (folder / HASHES).write_bytes(table)
            tables[target.name][f"{folder.name}/{HASHES}"] = digest(table)
    counts = {"frames": record["frames"], "failed_frames": failed, "subset": record}
    for source, target in zip(large.trees, small.trees, strict=True):
        for name, recorded in (read_hashes(source) or {}).items():
            if name.endswith(f"/{HASHES}"):
                continue
            data = read_bytes(source / name)
            if digest(data) != recorded:  # of a file in a deeper folder
                raise DamageError(f"{source / name}: is not what was generated; {MEND}")
            if source / name == large.manifest:
                data = manifest_bytes({**json.loads(data), **counts})
            elif source / name == large.identity:
                data = (json.dumps({**json.loads(data), "subset": record}) + "\n").encode()
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_bytes(data)
            tables[target.name][name] = digest(data)
    seal_copy(small, tables)


def _shard_files(folder: Path, frames: Frames) -> Iterator[tuple[str, bytes]]:
    """Yield the names and contents of the files of a shard in one tree, checked.

    Of a shard that is not whole these are the files and rows of the chosen frames only.
    """
    for name in read_hashes(folder) or {}:
        path = folder / name
        if frames.whole:
            yield name, read_bytes(path)
        elif name == TRUTH_TABLE:
            stream = io.BytesIO()
            table = read_parquet(path, read_bytes(path))
            table.filter(pl.col("frame_id").is_in(frames.names)).write_parquet(stream)
            yield name, stream.getvalue()
        elif name == METADATA:
            yield name, _rows(read_bytes(path).decode(), frames).encode()
        elif path.stem in frames.names:
            yield name, read_bytes(path)


def _rows(text: str, frames: Frames) -> str:
    """Select the rows of a metadata.csv that are those of chosen frames."""
    head, *rows = csv.reader(io.StringIO(text))
    place, stream = head.index("frame_id"), io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(
        [head, *(row for row in rows if row[place] in frames.names)]
    )
    return stream.getvalue()
