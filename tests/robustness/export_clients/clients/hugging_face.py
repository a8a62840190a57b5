"""Read a Hugging Face export with `datasets`."""

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


def hugging_face(folder: Path, rows: Rows) -> Iterator[Check]:
    """Load a Hugging Face export as a whole, and as a stream."""
    from datasets import Image, load_dataset

    loaded = load_dataset(str(folder))
    frames = [(split, row) for split in loaded for row in loaded[split]]
    yield check("frames by split", by_split(rows), Counter(split for split, _ in frames))
    keys = {Path(row["path"]).stem: row for row in _raw_images(loaded, Image)}
    yield check("names of images", set(rows), set(keys))
    loaded_rows = {frame_key(rows, row): row for _, row in frames}
    yield from pixels(rows, {key: np.array(row["image"]) for key, row in loaded_rows.items()})
    yield labels(rows, loaded_rows)
    stream = load_dataset(str(folder), streaming=True)
    count = sum(1 for split in stream for _ in stream[split])
    yield check("frames of the stream", len(rows), count)


def _raw_images(loaded: Any, image: Any) -> Iterator[dict[str, Any]]:
    for split in loaded:
        yield from loaded[split].cast_column("image", image(decode=False))["image"]
