"""Read a WebDataset export with `webdataset`."""

import io
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.robustness.export_clients.clients.check import (
    Check,
    Rows,
    by_split,
    check,
    labels,
    pixels,
)


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
    yield check("frames by split", by_split(rows), splits)
    yield check("names of samples", set(rows), set(loaded_rows))
    images = {
        key: np.array(PIL.Image.open(io.BytesIO(sample["png"])))
        for key, sample in loaded_rows.items()
    }
    yield from pixels(rows, images)
    yield labels(rows, {key: sample["json"] for key, sample in loaded_rows.items()})
    together = webdataset.WebDataset([str(file) for file in files], shardshuffle=False)
    yield check("frames of all files together", len(rows), sum(1 for _ in together))
