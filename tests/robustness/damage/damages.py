"""Random damages of one file: flipped bytes, truncation, deletion, another name."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np


def flip(path: Path, rng: np.random.Generator) -> None:
    """Change one byte of a file to another value: the damage that is hardest to notice."""
    data = bytearray(path.read_bytes())
    data[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
    path.write_bytes(data)


def truncate(path: Path, rng: np.random.Generator) -> None:
    """Cut a file to a random length, which may be 0."""
    data = path.read_bytes()
    path.write_bytes(data[: int(rng.integers(len(data)))])


def delete(path: Path, _rng: np.random.Generator) -> None:
    """Remove a file."""
    path.unlink()


def rename(path: Path, rng: np.random.Generator) -> None:
    """Give a file another name with the same suffix, in the same folder."""
    path.rename(path.with_name(f"{rng.integers(1 << 63):016x}{path.suffix}"))


DAMAGES: Final[dict[str, Callable[[Path, np.random.Generator], None]]] = {
    "flip": flip,
    "truncate": truncate,
    "delete": delete,
    "rename": rename,
}


def kind_of(name: str) -> str:
    """Return the kind of a file of a dataset from its path, without numbers and frame ids."""
    name = re.sub(r"shard_\d+", "shard_*", name)
    name = re.sub(r"[0-9a-f]{8,}(\.\w+)$", r"*\1", name)
    name = re.sub(r"(view|rest)_\d+", r"\1_*", name)
    return re.sub(r"predictions/[^/]*\.(csv|parquet)$", r"predictions/*.\1", name)
