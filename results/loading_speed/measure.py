"""Measure how fast frames are loaded for training, and check each against OpenCV's reading."""

import pickle
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.hashes import digest
from vbaa_bench.dataset.frame_index import index_frames
from vbaa_bench.dataset.frame_records import FrameRecords, frame_records
from vbaa_bench.dataset.labels import USUAL_LABELS

# Seconds for which each way of loading is measured, after its first epoch. Chosen: rates then
# differ by a few per cent from run to run.
_SECONDS: Final = 5.0
_BATCH: Final = 16


class Way(NamedTuple):
    """A way of loading: worker processes, how they are started, and whether hashes are checked."""

    workers: int
    start: str
    check: bool

    def __str__(self) -> str:
        """Describe this way in a table."""
        processes = f"{self.workers} workers, {self.start}" if self.workers else "this process"
        return f"{processes}, {'checked' if self.check else 'not checked'}"


WAYS: Final = (
    Way(0, "", check=True),
    Way(0, "", check=False),
    Way(2, "fork", check=True),
    Way(2, "fork", check=False),
    Way(2, "spawn", check=True),
)


def measure(root: Path, seconds: float = _SECONDS) -> dict[str, Any]:
    """Measure the loading of a dataset by PyTorch's DataLoader, shuffled, in batches of 16.

    The record has the seconds to open it, the bytes that a frame takes in the index, the processor
    time of the hash of an image, and for each way the seconds of the first epoch, and after it the
    images per second and the processor time per image in this process, which other programs do not
    affect. Times of processors are in ms. Raises InputError without PyTorch, and if an image is not
    what OpenCV reads.
    """
    try:
        import torch
    except ImportError as error:
        raise InputError("this measurement needs PyTorch, the extra '.[torch]'") from error
    torch.set_num_threads(1)  # as in the DataLoader's workers
    start = time.perf_counter()
    records = _open(root, check=True)
    opened_s = time.perf_counter() - start
    bits = _check_pixels(records)
    rates = {}
    for way in WAYS:
        options = {"persistent_workers": True, "multiprocessing_context": way.start}
        loader = torch.utils.data.DataLoader(
            _open(root, way.check),
            batch_size=_BATCH,
            shuffle=True,
            num_workers=way.workers,
            **(options if way.workers else {}),
        )
        rates[str(way)] = _rate(loader, len(records), seconds)
    height, width = records[0]["image"].shape[1:]
    return {
        "dataset": root.name,
        "frames": len(records),
        "image": f"{width} x {height} px, {bits} bits",
        "opened_s": opened_s,
        "index_bytes_per_frame": len(pickle.dumps(records)) / len(records),
        "hash_ms": _hash_ms(records),
        "torch": torch.__version__,
        "ways": rates,
    }


def _open(root: Path, check: bool) -> FrameRecords:
    return frame_records(index_frames(root, None, USUAL_LABELS, check=check), False, None)


def _check_pixels(records: FrameRecords) -> int:
    """Compare all images with OpenCV's reading; return the bit depth of the files."""
    index, bits = records.index, 8
    for number, record in enumerate(records):
        shard = index.shards[index.shard[number]]
        path = Path(shard.folder) / f"{record['frame_id']}.png"
        stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert stored is not None
        bits = 8 * stored.itemsize
        expected = stored[None].astype(np.float32) / np.float32(shard.full_scale)
        if not np.array_equal(np.asarray(record["image"]), expected):
            raise InputError(f"{path}: the loaded image is not the one that OpenCV reads")
    return bits


def _hash_ms(records: FrameRecords) -> float:
    """Measure the processor time of hashing an image file, in ms."""
    index, elapsed = records.index, 0.0
    for number, name in enumerate(index.frame_id):
        folder = Path(index.shards[index.shard[number]].folder)
        content = (folder / f"{name.decode()}.png").read_bytes()
        start = time.process_time()
        digest(content)
        elapsed += time.process_time() - start
    return 1e3 * elapsed / len(records)


def _rate(loader: Any, frames: int, seconds: float) -> dict[str, float]:
    """Measure a loader. Raises InputError unless each epoch has every frame once."""
    start = time.perf_counter()
    _epoch(loader, frames)
    first_s, images = time.perf_counter() - start, 0
    start, start_processor = time.perf_counter(), time.process_time()
    while not images or time.perf_counter() - start < seconds:
        images += _epoch(loader, frames)
    return {
        "first_epoch_s": first_s,
        "images_per_s": images / (time.perf_counter() - start),
        "processor_ms": 1e3 * (time.process_time() - start_processor) / images,
    }


def _epoch(loader: Any, frames: int) -> int:
    names = [name for batch in loader for name in batch["frame_id"]]
    if len(set(names)) != frames or len(names) != frames:
        raise InputError(f"an epoch has {len(names)} of {frames} frames")
    return len(names)


def page(measured: Sequence[dict[str, Any]], command: str) -> str:
    """Write the measurements as Markdown."""
    return "\n".join([*_datasets(measured, command), *_ways(measured), ""])


def _datasets(measured: Sequence[dict[str, Any]], command: str) -> Iterator[str]:
    yield "# Loading frames for training"
    yield ""
    yield f"Measured with `{command}`"
    yield f"and PyTorch {measured[0]['torch']}, with the files in the page cache. Batches of"
    yield f"{_BATCH} are shuffled. Every image was equal to what OpenCV reads, and every epoch had"
    yield "each frame once. Processor times are those of one thread that reads, checks, decodes"
    yield "and collates."
    yield ""
    yield (
        "| dataset | frames | image | opened in, s | index, bytes per frame | "
        "processor time per image, ms | of which the hash, ms |"
    )
    yield "|---|---:|---|---:|---:|---:|---:|"
    for one in measured:
        cells = (
            one["dataset"],
            str(one["frames"]),
            one["image"],
            f"{one['opened_s']:.2f}",
            f"{one['index_bytes_per_frame']:.0f}",
            f"{one['ways'][str(WAYS[0])]['processor_ms']:.2f}",
            f"{one['hash_ms']:.2f}",
        )
        yield f"| {' | '.join(cells)} |"
    yield ""


def _ways(measured: Sequence[dict[str, Any]]) -> Iterator[str]:
    yield "Images per second after the first epoch, on two cores that other programs used as well,"
    yield "and in brackets the seconds of the first epoch with the start of the workers:"
    yield ""
    yield f"| way | {' | '.join(one['dataset'] for one in measured)} |"
    yield f"|---|{'---:|' * len(measured)}"
    for way in map(str, WAYS):
        cells = (
            f"{one['ways'][way]['images_per_s']:.0f} ({one['ways'][way]['first_epoch_s']:.1f})"
            for one in measured
        )
        yield f"| {way} | {' | '.join(cells)} |"
