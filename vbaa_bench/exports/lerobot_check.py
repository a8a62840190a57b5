"""Reading of a LeRobot dataset, from its metadata alone, as LeRobot does."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from vbaa_bench.exports.format import Exported
from vbaa_bench.exports.source import Source

_NUMBERING: Final = ("index", "episode_index", "frame_index", "timestamp", "task_index")


def read_frames(folder: Path) -> Iterator[Exported]:
    """Read the frames of every episode from the file, and the rows, that the episode states."""
    info = _info(folder)
    splits = _split_ranges(info)
    for (chunk, file), episodes in _episodes(folder).group_by(
        "data/chunk_index", "data/file_index", maintain_order=True
    ):
        path = folder / info["data_path"].format(chunk_index=chunk, file_index=file)
        frames = pl.scan_parquet(path)
        start = frames.select(pl.col("index").first()).collect().item()
        for episode in episodes.iter_rows(named=True):
            begin, end = episode["dataset_from_index"], episode["dataset_to_index"]
            split = next(
                name for name, range_ in splits.items() if episode["episode_index"] in range_
            )
            for row in frames.slice(begin - start, end - begin).collect().iter_rows(named=True):
                yield _exported(row, info["features"], split)


def _exported(row: dict[str, Any], features: dict[str, Any], split: str) -> Exported:
    values: dict[str, Any] = {}
    for name, value in row.items():
        if name.startswith(("truth.", "reading.")):
            values[name.partition(".")[2]] = value
    values |= {name: row[name] for name in ("rig", "frame_id", "split", "push_id", "step")}
    # The action is in single precision, as the state; where both have the motor angle they agree.
    for name in ("observation.state", "action"):
        if name in features:
            numbers = np.atleast_1d(row[name]).astype(np.float32)
            values |= dict(zip(features[name]["names"], numbers, strict=True))
    key = row["frame_id"] if row["rig"] == "rig" else f"{row['rig']}_{row['frame_id']}"
    return Exported(key, split, row["observation.image"]["bytes"], values)


def structure_errors(folder: Path, source: Source) -> Iterator[str]:
    """Check totals, numbering of frames, offsets of episodes, splits and ranges of statistics."""
    info, episodes = _info(folder), _episodes(folder)
    files = sorted((folder / "data").glob("*/*.parquet"))
    frames = pl.concat([pl.read_parquet(file, columns=list(_NUMBERING)) for file in files])
    totals = {"total_frames": frames.height, "total_episodes": episodes.height, "total_tasks": 1}
    for name, total in totals.items():
        if info[name] != total:
            yield f"meta/info.json: {name} is {info[name]}, but there are {total}"
    if not np.array_equal(frames["index"], np.arange(frames.height)):
        yield "data: the column index does not count the frames of all files"
    actual = frames.group_by("episode_index", maintain_order=True).agg(
        pl.col("index").first().alias("first"),
        pl.col("index").last().alias("last") + 1,
        pl.len().alias("length").cast(pl.Int64),
        (pl.col("frame_index") == pl.int_range(pl.len())).all().alias("counted"),
    )
    stated = episodes.select("episode_index", "dataset_from_index", "dataset_to_index", "length")
    if not np.array_equal(actual.drop("counted").to_numpy(), stated.to_numpy()):
        yield "meta/episodes: offsets are not those of the frames in data"
    if not actual["counted"].all():
        yield "data: frame_index does not count the frames of an episode from 0"
    ranges = _split_ranges(info)
    counts = {
        name: int(episodes["length"][range_.start : range_.stop].sum())
        for name, range_ in ranges.items()
    }
    if counts != source.splits:
        yield f"meta/info.json: splits have {counts} frames, the dataset {source.splits}"
    stats = json.loads((folder / "meta" / "stats.json").read_bytes())
    for name, values in stats.items():
        low, middle, high = (np.array(values[key]) for key in ("min", "mean", "max"))
        if not (np.all(low <= middle + 1e-9) and np.all(middle <= high + 1e-9)):
            yield f"meta/stats.json: the mean of {name} is not between its limits"
    tasks = pl.read_parquet(folder / "meta" / "tasks.parquet").height
    if tasks != info["total_tasks"]:
        yield f"meta/tasks.parquet: has {tasks} tasks, meta/info.json {info['total_tasks']}"


def _info(folder: Path) -> dict[str, Any]:
    info: dict[str, Any] = json.loads((folder / "meta" / "info.json").read_bytes())
    return info


def _split_ranges(info: dict[str, Any]) -> dict[str, range]:
    return {name: range(*map(int, text.split(":"))) for name, text in info["splits"].items()}


def _episodes(folder: Path) -> pl.DataFrame:
    """Read the table of episodes, without statistics, in the order in which LeRobot does."""
    files = sorted((folder / "meta" / "episodes").glob("*/*.parquet"))
    return pl.concat(
        [pl.scan_parquet(file).select(pl.exclude("^stats/.*$")).collect() for file in files]
    )
