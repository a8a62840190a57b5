"""Check of a finished export: read it back, and compare every frame with the dataset."""

from collections.abc import Callable, Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from solver.instrument.hashes import digest
from solver.instrument.images import read_grey
from vbaa_bench.exports.format import Exported, Format
from vbaa_bench.exports.parts import parts
from vbaa_bench.exports.rig import Rig
from vbaa_bench.exports.source import Source

# Differences that are named. Chosen: one fault in a writer differs in every frame.
NAMED: Final = 10


def differences(
    exported: Format, folder: Path, source: Source, progress: Callable[[int], None]
) -> list[str]:
    """Compare an export with its dataset; return a sentence per difference, at most NAMED.

    Every frame is compared with that of its place: name, split, values and pixels. No frame can
    occur twice, as no two of the dataset have one name. The number of frames of each split is
    compared, and structure, such as offsets, is checked by the format. Raises InputError if the
    dataset is damaged.
    """
    named = []
    for message in _all_differences(exported, folder, source, progress):
        named.append(message)
        if len(named) == NAMED:
            break
    return named


def _all_differences(
    exported: Format, folder: Path, source: Source, progress: Callable[[int], None]
) -> Iterator[str]:
    counts = dict.fromkeys(source.splits, 0)
    rows = (row for part in parts(source, exported.cut) for row in part.table.iter_rows(named=True))
    frames = exported.read_back(folder, source)
    for done, (row, frame) in enumerate(zip_longest(rows, frames), start=1):
        if frame is None:
            yield f"the frame {source.key(row['rig'], row['frame_id'])} is missing"
            continue
        counts[frame.split] = counts.get(frame.split, 0) + 1
        if row is None:
            yield f"the frame {frame.key} is surplus"
            continue
        yield from _frame_differences(source, row, frame)
        progress(done)
    if counts != source.splits:
        yield f"it has {counts} frames by split, the dataset {source.splits}"
    yield from exported.structure_errors(folder, source)


def _frame_differences(source: Source, row: dict[str, Any], frame: Exported) -> Iterator[str]:
    key = source.key(row["rig"], row["frame_id"])
    if (frame.key, frame.split) != (key, row["split"]):
        yield f"the frame {frame.key} ({frame.split}) is in the place of {key} ({row['split']})"
        return
    for name, value in frame.values.items():
        if not same_value(value, row[name]):
            yield f"{name} of the frame {key} is {value}, not {row[name]}"
    rig, image = source.rigs[row["rig"]], frame.image
    if image is not None and not _same_image(image, rig, row["shard"], row["frame_id"]):
        yield f"the image of the frame {key} has other pixels than the dataset's"


def same_value(value: Any, expected: Any) -> bool:
    """Test whether an exported value is the dataset's; single precision is compared as such.

    A number that is missing is null or NaN, a text that is missing null or empty.
    """
    if isinstance(expected, list) and value is not None:
        return len(value) == len(expected) and all(map(same_value, value, expected))
    if expected is None:
        return _is_missing(value)
    if isinstance(value, np.float32):
        return bool(value == np.float32(expected))
    return bool(value == expected)


def _is_missing(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(map(_is_missing, value))
    if isinstance(value, float | np.floating):
        return bool(np.isnan(value))
    return value is None or value == ""


def _same_image(data: bytes, rig: Rig, shard: int, frame_id: str) -> bool:
    """Test whether an image has the dataset's pixels: the same bytes, or the same when decoded."""
    if digest(data) == rig.image_digest(shard, frame_id):
        return True
    if not data:
        return False
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    expected = read_grey(rig.image_path(shard, frame_id))
    if image is None or image.dtype != expected.dtype:
        return False
    channels = image[..., None] if image.ndim == 2 else image
    return bool(np.array_equal(channels, np.broadcast_to(expected[..., None], channels.shape)))
