"""LeRobotDataset v3.0: a push is an episode, the motor angle its action, the readings its state.

OUT/
  meta/info.json                              features, totals, splits as ranges of episodes
  meta/stats.json                             statistics of every feature
  meta/tasks.parquet                          the only task
  meta/episodes/chunk-000/file-000.parquet    one row per episode: its frames, file and statistics
  data/chunk-000/file-000.parquet             one row per frame, with its PNG

Source: lerobot 0.4.4, `datasets/lerobot_dataset.py` and `datasets/utils.py`. Offsets of episodes
count all frames of the export, so that they hold in all files (compare lerobot #2328 and #2438).
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

import cv2
import numpy as np
import polars as pl

from solver.instrument.arrays import Grey
from solver.instrument.files import write_text
from solver.instrument.images import to_grey
from vbaa_bench.exports.columns import CENTRELINE, VECTORS, Schema
from vbaa_bench.exports.format import Exported, Format
from vbaa_bench.exports.lerobot_stats import Stats, combined, image_stats, value_stats
from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parquet import TYPE_NAMES, features, image_column, write_parquet
from vbaa_bench.exports.parts import Cut, Frame, Part
from vbaa_bench.exports.source import Source

TASK: Final = "push the beam against the object"
# Files per folder: LeRobot's default; the names of files sort correctly up to 1,000.
_CHUNK: Final = 1000
# Frames of a push are states of equilibrium, without time. Chosen: one per second.
_FPS: Final = 1
# LeRobot's limit of a file is 100 MB; images in three channels are about three times larger.
_FILE_BYTES: Final = 32_000_000
# Frames per file. Chosen: the statistics of an episode take 100 kB until its file is written.
_FILE_FRAMES: Final = 2_000
_IMAGE: Final = "observation.image"
_STATE: Final = "observation.state"
_ACTION: Final = "action"
# Readings that are no state: an interval of the image to leave out, which may be null.
_INTERVAL: Final = ("removed_from_mm", "removed_to_mm")
_ENCODER: Final = "motor_angle_deg"
# Features that every LeRobot dataset has.
_USUAL: Final = {
    "timestamp": pl.Float32(),
    "frame_index": pl.Int64(),
    "episode_index": pl.Int64(),
    "index": pl.Int64(),
    "task_index": pl.Int64(),
}


class Feature(NamedTuple):
    """A feature: its columns of the table, and the type of its values.

    A feature of several columns, and one of a vector, has `size` values; others one.
    """

    columns: tuple[str, ...]
    dtype: pl.DataType
    size: int = 1

    @property
    def values(self) -> pl.Expr:
        """The feature's column: a missing number is NaN, a missing text is empty."""
        (first, *others), missing = self.columns, pl.lit(float("nan"))
        if self.dtype == pl.String():
            return pl.col(first).fill_null("")
        if others or (self.size > 1 and first not in VECTORS):
            return pl.concat_list(self.columns).cast(pl.List(self.dtype))
        if self.size > 1:
            return pl.col(first).fill_null(pl.concat_list([missing] * self.size))
        filled = pl.col(first).fill_null(missing) if self.dtype.is_float() else pl.col(first)
        return filled.cast(self.dtype)

    @property
    def description(self) -> dict[str, Any]:
        """The entry of meta/info.json."""
        names = list("xyz") if self.columns[0] in VECTORS else list(self.columns)
        text = self.dtype == pl.String()
        return {
            "dtype": TYPE_NAMES[self.dtype],
            "shape": [self.size],
            "names": None if text else names,
        }


class LeRobot(Format):
    """Parquet files with whole episodes."""

    usual_cut: ClassVar = Cut(_FILE_BYTES, _FILE_FRAMES, whole_pushes=True)
    layout: ClassVar = """\
- `meta/`, `data/`: a LeRobotDataset v3.0. A push is an episode; `action` is the motor angle of the
  frame [deg], `observation.state` has the readings, and `truth.*` are the labels, NaN where there
  is no value. Frames are states of equilibrium: `timestamp` counts them, one per second.
- `observation.image` has three equal channels, as LeRobot's models expect.
- Lists of varying length (`hidden_stretches_mm`) are left out."""
    loading: ClassVar = """\
from lerobot.datasets.lerobot_dataset import LeRobotDataset

frames = LeRobotDataset("vbaa_bench/export", root="OUT")  # the folder of this card
image, action = frames[0]["observation.image"], frames[0]["action"]
"""

    def refusal(self, source: Source) -> str:
        """Say why not: images of two sizes or of 16 bits, or centrelines."""
        sizes = {(rig.camera.width, rig.camera.height) for rig in source.rigs.values()}
        if len(sizes) > 1:
            texts = " and ".join(f"{width} x {height}" for width, height in sorted(sizes)[:2])
            return f"its rigs have images of {texts} px, a LeRobot dataset has one size"
        if max(rig.bits for rig in source.rigs.values()) > 8:
            return "its images have 16 bits, those of LeRobot 8; export them to hf or webdataset"
        if any(name.startswith(CENTRELINE) for name in source.schema.types):
            return "LeRobot has no lists of varying length; leave out --centrelines"
        return ""

    def write_part(self, folder: Path, part: Part) -> Record:
        """Write one file of frames, and the file of its episodes."""
        labels = part.table.with_columns(
            pl.struct("rig", "push_id").rle_id().cast(pl.Int64).alias("_episode")
        )
        lengths = labels["_episode"].value_counts(sort=False).sort("_episode")["count"].to_list()
        steps = np.concatenate([np.arange(length) for length in lengths])
        chosen = (one.values.alias(name) for name, one in _features(part.source).items())
        table = part.table.select(chosen).with_columns(
            pl.Series("timestamp", steps / _FPS, dtype=pl.Float32),
            pl.Series("frame_index", steps, dtype=pl.Int64),
            labels["_episode"].alias("episode_index") + part.first_push,
            pl.Series("index", part.first_frame + np.arange(part.table.height), dtype=pl.Int64),
            pl.lit(0, dtype=pl.Int64).alias("task_index"),
        )
        images: list[tuple[str, bytes]] = []
        per_episode, begin, frames = [], 0, part.frames()
        for length in lengths:
            grays = [_gray(next(frames)) for _ in range(length)]
            images += [(f"frame-{i:06d}.png", _png(gray)) for i, gray in enumerate(grays)]
            episode = table[begin : begin + length]
            per_episode.append({_IMAGE: image_stats(grays), **_stats(episode)})
            begin += length
        place = _file(part)
        table = table.insert_column(0, image_column(_IMAGE, images))
        write_parquet(folder / "data" / place, table, {"huggingface": features(table.schema)})
        write_parquet(
            folder / "meta" / "episodes" / place, _episodes(part, lengths, per_episode), {}
        )
        totals = {name: combined([stats[name] for stats in per_episode]) for name in per_episode[0]}
        return {"split": part.split, "episodes": len(lengths), "stats": _lists(totals)}

    def finish(self, folder: Path, source: Source, records: Sequence[Record]) -> None:
        """Write info.json, stats.json and the table of tasks."""
        splits, episodes = {}, 0
        for split in source.splits:
            first = episodes
            episodes += sum(record["episodes"] for record in records if record["split"] == split)
            splits[split] = f"{first}:{episodes}"
        info = {
            "codebase_version": "v3.0",
            "robot_type": "vision_based_active_antenna",
            "total_episodes": episodes,
            "total_frames": source.frames,
            "total_tasks": 1,
            "chunks_size": _CHUNK,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": _FPS,
            "splits": splits,
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": None,
            "features": _described(source),
        }
        parts = [_arrays(record["stats"]) for record in records]
        stats = {name: combined([part[name] for part in parts]) for name in parts[0]}
        write_text(folder / "meta" / "info.json", json.dumps(info, indent=4) + "\n")
        write_text(folder / "meta" / "stats.json", json.dumps(_lists(stats), indent=4) + "\n")
        tasks = pl.DataFrame({"task_index": [0], "task": [TASK]})
        write_parquet(folder / "meta" / "tasks.parquet", tasks, {"pandas": _PANDAS})

    def read_back(self, folder: Path, _source: Source) -> Iterator[Exported]:
        """Read the frames of every episode from the file and the rows that the episode states."""
        info = _info(folder)
        splits = _split_ranges(info)
        for (chunk, file), episodes in _stored_episodes(folder).group_by(
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

    def structure_errors(self, folder: Path, source: Source) -> Iterator[str]:
        """Check totals, numbering, offsets of episodes, splits and the ranges of statistics."""
        info, episodes = _info(folder), _stored_episodes(folder)
        files = sorted((folder / "data").glob("*/*.parquet"))
        frames = pl.concat([pl.read_parquet(file, columns=list(_USUAL)) for file in files])
        totals = {
            "total_frames": frames.height,
            "total_episodes": episodes.height,
            "total_tasks": 1,
        }
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
        stated = episodes.select(
            "episode_index", "dataset_from_index", "dataset_to_index", "length"
        )
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


# What pandas writes, so that the task is the index of the table.
_PANDAS: Final = {
    "index_columns": ["task"],
    "column_indexes": [],
    "columns": [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": dtype}
        | {"metadata": None}
        for name, kind, dtype in (
            ("task_index", "int64", "int64"),
            ("task", "unicode", "object"),
        )
    ],
    "pandas_version": "2.0.0",
}


def _features(source: Source) -> dict[str, Feature]:
    """Choose all features of a source except the image and the usual ones.

    The state has all readings, the action is the motor angle: the encoder's or, if the camera is
    fixed in the world and there is no encoder, the true one. Lists of varying length are left out.
    """
    schema, rigs = source.schema, source.rigs.values()
    fixed = any(rig.stated("camera.mount") == "world" for rig in rigs)
    without = {*_INTERVAL, _ENCODER} if fixed else {*_INTERVAL}
    state = tuple(name for name in schema.readings if name not in without)
    angle = "true_motor_angle_deg" if fixed else _ENCODER
    features = {_ACTION: Feature((angle,), pl.Float32())}
    if state:
        features[_STATE] = Feature(state, pl.Float32(), len(state))
    names = ["rig", "frame_id", "split", "push_id", "step"]
    features |= {name: _single(schema, name) for name in names}
    readings = [name for name in _INTERVAL if name in schema.types]
    features |= {f"reading.{name}": _single(schema, name) for name in readings}
    labels = [
        name
        for name in schema.labels
        if name in VECTORS or not isinstance(schema.types[name], pl.List)
    ]
    features |= {f"truth.{name}": _single(schema, name) for name in labels}
    return features


def _single(schema: Schema, name: str) -> Feature:
    if name in VECTORS:
        return Feature((name,), pl.Float64(), 3)
    # Whole numbers of the truth may be null, as the contact's row, which NaN stands for.
    dtype = schema.types[name]
    return Feature((name,), pl.Float64() if dtype == pl.Int64() and name != "step" else dtype)


def _described(source: Source) -> dict[str, Any]:
    """Describe all features of a source, whose images have one size, for meta/info.json."""
    camera = next(iter(source.rigs.values())).camera
    image = {
        "dtype": "image",
        "shape": [camera.height, camera.width, 3],
        "names": ["height", "width", "channels"],
    }
    usual = {
        name: {"dtype": TYPE_NAMES[dtype], "shape": [1], "names": None}
        for name, dtype in _USUAL.items()
    }
    chosen = {name: feature.description for name, feature in _features(source).items()}
    return {_IMAGE: image, **chosen, **usual}


def _file(part: Part) -> str:
    return f"chunk-{part.index // _CHUNK:03d}/file-{part.index % _CHUNK:03d}.parquet"


def _gray(frame: Frame) -> Grey:
    """Decode the image of a frame."""
    data = cv2.imdecode(np.frombuffer(frame.png, np.uint8), cv2.IMREAD_UNCHANGED)
    return to_grey(data, frame.key)


def _png(gray: Grey) -> bytes:
    """Encode a gray image in three equal channels: LeRobot's own writer accepts no others."""
    ok, data = cv2.imencode(".png", cv2.merge([gray] * 3))
    if not ok:
        raise ValueError(f"an image of shape {gray.shape} cannot be encoded as PNG")
    return bytes(data)


def _stats(episode: pl.DataFrame) -> dict[str, Stats]:
    """Compute the statistics of the numbers of an episode."""
    arrays = {
        name: np.array(episode[name].to_list(), dtype=np.float64).reshape(episode.height, -1)
        for name, dtype in episode.schema.items()
        if dtype != pl.String()
    }
    return {name: value_stats(values) for name, values in arrays.items()}


def _episodes(part: Part, lengths: list[int], stats: list[dict[str, Stats]]) -> pl.DataFrame:
    """Make the table of the episodes of a part."""
    ends = part.first_frame + np.cumsum(lengths)
    count = len(lengths)
    columns: dict[str, Any] = {
        "episode_index": np.arange(part.first_push, part.first_push + count),
        "tasks": [[TASK]] * count,
        "length": lengths,
        "data/chunk_index": [part.index // _CHUNK] * count,
        "data/file_index": [part.index % _CHUNK] * count,
        "dataset_from_index": ends - lengths,
        "dataset_to_index": ends,
    }
    for name, values in stats[0].items():
        for key in values:
            columns[f"stats/{name}/{key}"] = [episode[name][key].tolist() for episode in stats]
    columns["meta/episodes/chunk_index"] = columns["data/chunk_index"]
    columns["meta/episodes/file_index"] = columns["data/file_index"]
    return pl.DataFrame(columns)


def _lists(stats: dict[str, Stats]) -> dict[str, dict[str, Any]]:
    return {name: {key: v.tolist() for key, v in values.items()} for name, values in stats.items()}


def _arrays(stats: dict[str, dict[str, Any]]) -> dict[str, Stats]:
    return {name: {key: np.array(v) for key, v in values.items()} for name, values in stats.items()}


def _exported(row: dict[str, Any], features: dict[str, Any], split: str) -> Exported:
    values: dict[str, Any] = {}
    for name, value in row.items():
        if name.startswith(("truth.", "reading.")):
            values[name.partition(".")[2]] = value
    values |= {name: row[name] for name in ("rig", "frame_id", "split", "push_id", "step")}
    # The action is in single precision, as the state; where both have the motor angle they agree.
    for name in (_STATE, _ACTION):
        if name in features:
            numbers = np.atleast_1d(row[name]).astype(np.float32)
            values |= dict(zip(features[name]["names"], numbers, strict=True))
    key = row["frame_id"] if row["rig"] == "rig" else f"{row['rig']}_{row['frame_id']}"
    return Exported(key, split, row[_IMAGE]["bytes"], values)


def _info(folder: Path) -> dict[str, Any]:
    info: dict[str, Any] = json.loads((folder / "meta" / "info.json").read_bytes())
    return info


def _split_ranges(info: dict[str, Any]) -> dict[str, range]:
    return {name: range(*map(int, text.split(":"))) for name, text in info["splits"].items()}


def _stored_episodes(folder: Path) -> pl.DataFrame:
    """Read the table of episodes, without statistics, in the order in which LeRobot does."""
    files = sorted((folder / "meta" / "episodes").glob("*/*.parquet"))
    return pl.concat(
        [pl.scan_parquet(file).select(pl.exclude("^stats/.*$")).collect() for file in files]
    )
