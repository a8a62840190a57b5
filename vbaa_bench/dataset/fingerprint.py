"""Fingerprint of what methods may read of a dataset, by which frames are known on any processor.

On another kind of processor, some pixels of some images differ by rounding, so that their bytes
prove nothing. A fingerprint has

- `images`: of every image, by rig and name, the sum of its gray values, each with a fixed random
  sign. The sums of two images differ by about the root of the sum of the squares of the differences
  of their pixels (Achlioptas 2003): by 0 to 20 where few pixels differ by rounding, by 600 where
  the noise is another;
- `others`: a digest of all other files, rig.json and the readings, with numbers of nine digits: the
  last ones of the readings follow from mechanics, and may differ by rounding, too.
"""

import re
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.hashes import HASHES, digest, read_bytes
from solver.instrument.images import ALL_CHANNELS, read_channels
from vbaa_bench.dataset.collection import rigs_of
from vbaa_bench.dataset.document import Document, read_json

_IMAGE: Final = ".png"
# Largest root mean square difference of two images, over the brightest gray value, that is called
# rounding. Chosen: a tenth of a gray value of 8 bits; the sensor's noise is about one.
_ROUNDING: Final = 0.1 / 255
_NUMBER: Final = re.compile(rb"-?\d+\.\d+(e[-+]?\d+)?")


class Fingerprint(Document):
    """The fingerprint of a dataset or collection, see above; `images` are numbers and spaces."""

    images: str
    others: str


class Compared(NamedTuple):
    """Number of images, of those with the same sum, and of those with the same but for rounding.

    `others` says whether the other files are equal.
    """

    images: int
    same: int
    rounded: int
    others: bool

    @property
    def exact(self) -> bool:
        """Whether no sum and no other file differs."""
        return self.others and self.same == self.images


class _Sum(NamedTuple):
    """The sum of an image's signed gray values, and its largest change by rounding."""

    value: int
    rounding: float


def fingerprint(root: Path) -> Fingerprint:
    """Compute the fingerprint of a dataset or collection. Raises InputError."""
    images = " ".join(str(one.value) for one in _sums(root))
    return Fingerprint(images=images, others=others_digest(root))


def compare(root: Path, known: Fingerprint) -> Compared:
    """Compare a dataset or collection with a fingerprint. Raises InputError.

    With another number of images none has the same sum.
    """
    sums, there = _sums(root), [int(value) for value in known.images.split()]
    others = others_digest(root) == known.others
    if len(sums) != len(there):
        return Compared(len(there), 0, 0, others)
    changes = [abs(one.value - value) for one, value in zip(sums, there, strict=True)]
    rounded = sum(change <= one.rounding for one, change in zip(sums, changes, strict=True))
    return Compared(len(sums), changes.count(0), rounded, others)


def others_digest(root: Path) -> str:
    """Compute the digest of all files but images, see above. Raises InputError."""
    texts = [read_bytes(path) for path in _files(root) if path.suffix != _IMAGE]
    return digest(b"\n".join(_NUMBER.sub(_nine_digits, text) for text in texts))


def _nine_digits(number: re.Match[bytes]) -> bytes:
    return f"{float(number[0]):.9g}".encode()


def _sums(root: Path) -> list[_Sum]:
    return [_sum(path) for path in _files(root) if path.suffix == _IMAGE]


def _sum(path: Path) -> _Sum:
    pixels = read_channels(path, ALL_CHANNELS).ravel().astype(np.int64)
    # Philox gives the same bits in every version of NumPy.
    words = np.random.Philox(key=0).random_raw(len(pixels) // 64 + 1).astype("<u8")
    signs = 2 * np.unpackbits(words.view(np.uint8))[: len(pixels)].astype(np.int64) - 1
    rounding = _ROUNDING * float(pixels.max(initial=1)) * len(pixels) ** 0.5
    return _Sum(int(signs @ pixels), rounding)


def _files(root: Path) -> list[Path]:
    """List the files of the observations of all rigs, by rig and name. Raises InputError."""
    return [
        table.parent / name
        for layout in rigs_of(root)
        for table in sorted({layout.hashes, *layout.observations.glob(f"shard_*/{HASHES}")})
        for name in sorted(read_json(table))
        if not name.endswith(HASHES)
    ]
