"""Programs that read exports with the client libraries; they run in other environments.

    python clients.py CLIENT FOLDER EXPECTED

FOLDER is an export, EXPECTED a file with one JSON object per frame of the dataset. The result is a
JSON list of checks: what is asked, what is expected and what is measured. Network connections are
refused. Nothing of vbaa_bench is imported.
"""

import hashlib
import io
import json
import math
import socket
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

Check = dict[str, str]
Rows = dict[str, dict[str, Any]]


def main() -> None:
    """Run one client and print its checks."""
    client, folder, expected = sys.argv[1:]
    socket.socket.connect = _refuse  # type: ignore[method-assign]
    rows = {}
    for line in Path(expected).read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        rows[row["key"]] = row
    json.dump(list(CLIENTS[client](Path(folder), rows)), sys.stdout)


def _refuse(*_: object) -> None:
    raise OSError("no network here")


def hugging_face(folder: Path, rows: Rows) -> Iterator[Check]:
    """Load a Hugging Face export as a whole, and as a stream."""
    from datasets import Image, load_dataset

    loaded = load_dataset(str(folder))
    frames = [(split, row) for split in loaded for row in loaded[split]]
    yield _check("frames by split", _by_split(rows), Counter(split for split, _ in frames))
    keys = {Path(row["path"]).stem: row for row in _raw_images(loaded, Image)}
    yield _check("names of images", set(rows), set(keys))
    loaded_rows = {_key(rows, row): row for _, row in frames}
    yield from _pixels(rows, {key: np.array(row["image"]) for key, row in loaded_rows.items()})
    yield _labels(rows, loaded_rows)
    stream = load_dataset(str(folder), streaming=True)
    count = sum(1 for split in stream for _ in stream[split])
    yield _check("frames of the stream", len(rows), count)


def _raw_images(loaded: Any, image: Any) -> Iterator[dict[str, Any]]:
    for split in loaded:
        yield from loaded[split].cast_column("image", image(decode=False))["image"]


def web_dataset(folder: Path, rows: Rows) -> Iterator[Check]:
    """Iterate over the tar files of a WebDataset export."""
    import PIL.Image
    import webdataset

    files = sorted(folder.glob("*.tar"))
    loaded_rows, splits = {}, Counter[str]()
    for file in files:
        for sample in webdataset.WebDataset(str(file), shardshuffle=False).decode():
            splits[file.stem.rpartition("-")[0]] += 1
            loaded_rows[sample["__key__"]] = sample
    yield _check("frames by split", _by_split(rows), splits)
    yield _check("names of samples", set(rows), set(loaded_rows))
    images = {
        key: np.array(PIL.Image.open(io.BytesIO(sample["png"])))
        for key, sample in loaded_rows.items()
    }
    yield from _pixels(rows, images)
    yield _labels(rows, {key: sample["json"] for key, sample in loaded_rows.items()})
    together = webdataset.WebDataset([str(file) for file in files], shardshuffle=False)
    yield _check("frames of all files together", len(rows), sum(1 for _ in together))


def lerobot(folder: Path, rows: Rows) -> Iterator[Check]:
    """Load a LeRobot export: frames, episodes, offsets, windows in time and statistics."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    data = LeRobotDataset("vbaa_bench/export", root=folder)
    items = [data[i] for i in range(len(data))]
    yield _check("frames", len(rows), len(items))
    files = len(list(folder.glob("data/*/*.parquet")))
    yield _check("files of frames, of which each has its episodes", files, _stated_files(data))
    loaded_rows = {_key(rows, item): item for item in items}
    yield _check("names of frames", set(rows), set(loaded_rows))
    images, gray = {}, 0
    for key, item in loaded_rows.items():
        channels = np.rint(255 * item["observation.image"].numpy()).astype(np.uint8)
        gray += bool((channels == channels[0]).all())
        images[key] = channels[0]
    yield _check("images of three equal channels", len(rows), gray)
    yield from _pixels(rows, images)
    truth = {key: _without_prefix(item) for key, item in loaded_rows.items()}
    yield _labels(rows, truth, np.float32)
    action = sum(
        float(item["action"]) == np.float32(rows[key]["motor_angle_deg"])
        for key, item in loaded_rows.items()
        if rows[key]["motor_angle_deg"] is not None
    )
    yield _check("actions equal to motor angles", len(rows), action)
    yield from _episodes(data, items, rows)
    yield from _windows(LeRobotDataset, folder, data, items)
    yield _statistics(folder)


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
        pushes = {rows[_key(rows, frame)]["push_id"] for frame in frames}
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
    yield _check("episodes that are one push at the stated offsets", len(pushes), right)
    yield _check("frames by split", _by_split(rows), splits)


def _windows(dataset: Any, folder: Path, data: Any, items: list[dict[str, Any]]) -> Iterator[Check]:
    """Load the last episode alone, and pairs of a frame with the next one of its episode."""
    last = data.meta.total_episodes - 1
    alone = dataset("vbaa_bench/export", root=folder, episodes=[last])
    expected = [item["frame_id"] for item in items if int(item["episode_index"]) == last]
    yield _check(
        "frames of the last episode", expected, [alone[i]["frame_id"] for i in range(len(alone))]
    )
    pairs = dataset("vbaa_bench/export", root=folder, delta_timestamps={"action": [0.0, 1.0]})
    right = 0
    for i, item in enumerate(items):
        following = items[i + 1] if i + 1 < len(items) else item
        same = following["episode_index"] == item["episode_index"]
        next_action = following["action"] if same else item["action"]
        right += bool(pairs[i]["action"][1] == next_action)
    yield _check("frames whose next action is of their episode", len(items), right)


def _statistics(folder: Path) -> Check:
    """Combine the statistics of the episodes with LeRobot's own function."""
    import pyarrow.parquet as pq
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.utils import load_stats

    episodes: list[dict[str, dict[str, Any]]] = []
    for file in sorted(folder.glob("meta/episodes/*/*.parquet")):
        for row in pq.read_table(file).to_pylist():
            stats: dict[str, dict[str, Any]] = {}
            for name, value in row.items():
                if name.startswith("stats/"):
                    _, feature, key = name.split("/")
                    stats.setdefault(feature, {})[key] = np.array(value)
            episodes.append(stats)
    stated = load_stats(folder)
    # Without values a feature has count 0, for which LeRobot divides by zero.
    used = [name for name in stated if stated[name]["count"][0] > 0]
    kept = [{name: stats[name] for name in used} for stats in episodes]
    combined = aggregate_stats(kept)
    worst = max(
        float(np.max(np.abs(combined[name][key] - stated[name][key]) / _scale(stated[name][key])))
        for name in used
        for key in ("min", "max", "mean", "std", "count", "q50")
        if all(stats[name]["count"][0] > 0 for stats in kept)
    )
    return {
        "asked": "statistics combined by LeRobot, relative difference",
        "expected": "below 1e-9",
        "measured": f"{worst:.1g}",
        "right": str(worst < 1e-9),
    }


def _scale(values: Any) -> float:
    return float(max(np.max(np.abs(values)), 1e-3))


def croissant(folder: Path, rows: Rows) -> Iterator[Check]:
    """Validate croissant.json, and load the frames that it describes."""
    import mlcroissant

    data = mlcroissant.Dataset(folder / "croissant.json")
    issues = data.metadata.ctx.issues
    yield _check("errors of validation", 0, len(issues.errors))
    yield _check("warnings of validation", 0, len(issues.warnings))
    records = [
        {name.partition("/")[2]: _text(value) for name, value in record.items()}
        for record in data.records("frames")
    ]
    loaded_rows = {_key(rows, record): record for record in records}
    yield _check("frames", len(rows), len(records))
    yield _check("names of frames", set(rows), set(loaded_rows))
    yield _labels(rows, loaded_rows)
    if "image" in records[0]:
        yield from _pixels(rows, {key: np.array(row["image"]) for key, row in loaded_rows.items()})
    else:
        images = [_text(record["images/file_name"]) for record in data.records("images")]
        names = sorted(f"{row['frame_id']}.png" for row in rows.values())
        yield _check("names of images", names, sorted(images))
    yield _task(folder)


def _task(folder: Path) -> Check:
    """Test the task description against the rules of Croissant Tasks for a problem."""
    import rdflib

    graph = rdflib.Graph().parse(folder / "croissant_task.json", format="json-ld")
    cr = rdflib.Namespace("http://mlcommons.org/croissant/")
    problem = next(graph.subjects(rdflib.RDF.type, cr.TaskProblem))
    kinds = {
        "output": cr.OutputSpec,
        "implementation": cr.ImplementationSpec,
        "evaluation": cr.EvaluationSpec,
    }
    right = [
        (graph.value(problem, cr[name]), rdflib.RDF.type, kind) in graph
        for name, kind in kinds.items()
    ]
    schema = graph.value(graph.value(problem, cr.output), cr.schema)
    right.append((schema, rdflib.RDF.type, cr.RecordSet) in graph)
    fields = len(list(graph.objects(schema, cr.field)))
    asked = "rules of Croissant Tasks that are kept, and fields of the answer"
    return {
        "asked": asked,
        "expected": "4, at least 10",
        "measured": f"{sum(right)}, {fields}",
        "right": str(all(right) and fields >= 10),
    }


CLIENTS: Final[dict[str, Callable[[Path, Rows], Iterable[Check]]]] = {
    "hf": hugging_face,
    "webdataset": web_dataset,
    "lerobot": lerobot,
    "croissant": croissant,
}


def _check(asked: str, expected: Any, measured: Any) -> Check:
    """Compare two values; sets and lists are shown by their sizes."""
    return {
        "asked": asked,
        "expected": _short(expected),
        "measured": _short(measured),
        "right": str(expected == measured),
    }


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {count}" for name, count in sorted(value.items()))
    return str(len(value)) if isinstance(value, set | list) else str(value)


def _by_split(rows: Rows) -> dict[str, int]:
    return dict(Counter(row["split"] for row in rows.values()))


def _key(rows: Rows, row: dict[str, Any]) -> str:
    """Return the name of a frame, with the rig's in a collection."""
    name = _text(row["frame_id"])
    return name if name in rows else f"{_text(row['rig'])}_{name}"


def _text(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


def _without_prefix(item: dict[str, Any]) -> dict[str, Any]:
    """Return the labels of an item of LeRobot under their own names."""
    return {
        name.removeprefix("truth."): value.tolist() if hasattr(value, "tolist") else value
        for name, value in item.items()
        if name.startswith("truth.") or name in {"frame_id", "push_id", "step", "rig", "split"}
    }


def _pixels(rows: Rows, images: dict[str, Any]) -> Iterator[Check]:
    """Compare the sha256 of decoded pixels, in the dataset's type, and the type itself."""
    equal = sum(_digest(images[key]) == row["pixels"] for key, row in rows.items() if key in images)
    yield _check("images with equal pixels", len(rows), equal)
    types = {image.dtype.name for image in images.values()}
    expected = {row["dtype"] for row in rows.values()}
    yield _check("types of pixels", ", ".join(sorted(expected)), ", ".join(sorted(types)))


def _digest(image: Any) -> str:
    values = np.ascontiguousarray(image)
    return hashlib.sha256(values.astype(values.dtype.newbyteorder("<")).tobytes()).hexdigest()


def _labels(rows: Rows, loaded_rows: dict[str, dict[str, Any]], precision: Any = float) -> Check:
    """Compare every column that both have; a number in the precision of the client."""
    compared = equal = 0
    for key, row in rows.items():
        for name in row["columns"].keys() & loaded_rows.get(key, {}).keys():
            compared += 1
            equal += _same(row["columns"][name], loaded_rows[key][name], precision)
    return _check("equal readings and labels", compared, equal) | {
        "right": str(compared == equal and compared >= 20 * len(rows))
    }


def _same(expected: Any, value: Any, precision: Any) -> bool:
    if isinstance(expected, list):
        return len(expected) == len(value) and all(
            _same(one, two, precision) for one, two in zip(expected, value, strict=True)
        )
    if expected is None:
        empty = value is None or value == "" or (isinstance(value, float) and math.isnan(value))
        nothing = isinstance(value, list) and all(map(math.isnan, value))
        return bool(empty or nothing)
    if isinstance(expected, str | bool):
        return bool(value == expected)
    return bool(precision(value) == precision(expected))


if __name__ == "__main__":
    main()
