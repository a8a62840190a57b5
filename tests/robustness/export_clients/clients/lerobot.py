"""Read a LeRobot export with `lerobot`."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.robustness.export_clients.clients.check import (
    Check,
    Rows,
    by_split,
    check,
    frame_key,
    labels,
    pixels,
)
from tests.robustness.export_clients.clients.lerobot_statistics import statistics


def lerobot(folder: Path, rows: Rows) -> Iterator[Check]:
    """Load a LeRobot export: frames, episodes, offsets, windows in time and statistics."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    data = LeRobotDataset("vbaa_bench/export", root=folder)
    items = [data[i] for i in range(len(data))]
    yield check("frames", len(rows), len(items))
    files = len(list(folder.glob("data/*/*.parquet")))
    yield check("files of frames, of which each has its episodes", files, _stated_files(data))
    loaded_rows = {frame_key(rows, item): item for item in items}
    yield check("names of frames", set(rows), set(loaded_rows))
    images, gray = {}, 0
    for key, item in loaded_rows.items():
        channels = np.rint(255 * item["observation.image"].numpy()).astype(np.uint8)
        gray += bool((channels == channels[0]).all())
        images[key] = channels[0]
    yield check("images of three equal channels", len(rows), gray)
    yield from pixels(rows, images)
    truth = {key: _without_prefix(item) for key, item in loaded_rows.items()}
    yield labels(rows, truth, np.float32)
    action = sum(
        float(item["action"]) == np.float32(rows[key]["motor_angle_deg"])
        for key, item in loaded_rows.items()
        if rows[key]["motor_angle_deg"] is not None
    )
    yield check("actions equal to motor angles", len(rows), action)
    yield from _episodes(data, items, rows)
    yield from _windows(LeRobotDataset, folder, data, items)
    yield statistics(folder)


def _stated_files(data: Any) -> int:
    """Count the files that the episodes state."""
    names = ("data/chunk_index", "data/file_index")
    return len({tuple(episode[name] for name in names) for episode in data.meta.episodes})


def _episodes(data: Any, items: list[dict[str, Any]], rows: Rows) -> Iterator[Check]:
    """Check that each episode is one push, in order, at the offsets that it states."""
    right, splits = 0, Counter[str]()
    ranges = {
        name: range(*map(int, text.split(":"))) for name, text in data.meta.info["splits"].items()
    }
    for episode in data.meta.episodes:
        begin, end = episode["dataset_from_index"], episode["dataset_to_index"]
        frames = items[begin:end]
        number = episode["episode_index"]
        pushes = {rows[frame_key(rows, frame)]["push_id"] for frame in frames}
        steps = [int(frame["step"]) for frame in frames]
        right += (
            all(int(frame["episode_index"]) == number for frame in frames)
            and [int(frame["frame_index"]) for frame in frames] == list(range(end - begin))
            and [int(frame["index"]) for frame in frames] == list(range(begin, end))
            and len(pushes) == 1
            and steps == sorted(steps)
        )
        splits[next(name for name, range_ in ranges.items() if number in range_)] += len(frames)
    pushes = {row["push_id"] for row in rows.values()}
    yield check("episodes that are one push at the stated offsets", len(pushes), right)
    yield check("frames by split", by_split(rows), splits)


def _windows(dataset: Any, folder: Path, data: Any, items: list[dict[str, Any]]) -> Iterator[Check]:
    """Load the last episode alone, and pairs of a frame with the next one of its episode."""
    last = data.meta.total_episodes - 1
    alone = dataset("vbaa_bench/export", root=folder, episodes=[last])
    expected = [item["frame_id"] for item in items if int(item["episode_index"]) == last]
    yield check(
        "frames of the last episode", expected, [alone[i]["frame_id"] for i in range(len(alone))]
    )
    pairs = dataset("vbaa_bench/export", root=folder, delta_timestamps={"action": [0.0, 1.0]})
    right = 0
    for i, item in enumerate(items):
        following = items[i + 1] if i + 1 < len(items) else item
        same = following["episode_index"] == item["episode_index"]
        next_action = following["action"] if same else item["action"]
        right += bool(pairs[i]["action"][1] == next_action)
    yield check("frames whose next action is of their episode", len(items), right)


def _without_prefix(item: dict[str, Any]) -> dict[str, Any]:
    """Return the labels of an item of LeRobot under their own names."""
    return {
        name.removeprefix("truth."): value.tolist() if hasattr(value, "tolist") else value
        for name, value in item.items()
        if name.startswith("truth.") or name in {"frame_id", "push_id", "step", "rig", "split"}
    }
