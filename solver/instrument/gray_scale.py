"""How many bits a camera's gray values have, and where in 16 bits they are."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError

# Of industrial cameras (GenICam's Mono8 to Mono16).
_USUAL: Final = (8, 10, 12, 14, 16)


@dataclass(frozen=True)
class GrayScale:
    """Gray values of `bits` bits, `shift` bits above the lowest of the file's."""

    bits: int = 8
    shift: int = 0

    @property
    def full_scale(self) -> int:
        """The gray value of a saturated pixel."""
        return int(2**self.bits - 1)

    def __call__(self, image: Grey) -> Grey:
        """Shift an image (height, width) to gray values from 0 to `full_scale`.

        Raises InputError where it holds others: it was not stored as the images at rest were.
        """
        if image.dtype == np.uint8:
            if self.bits == 8:
                return image
            raise InputError(f"the image has 8 bits, the images at rest have {self.bits}")
        held = _bits_held(image)
        if held >> self.shift > self.full_scale or held & (2**self.shift - 1):
            where = "upper" if self.shift else "lower"
            raise InputError(
                f"the image has gray values up to {int(image.max())}, which are not in the "
                f"{where} {self.bits} of its 16 bits as those at rest are: store all images alike, "
                "or state camera.bits in rig.json"
            )
        return np.asarray(image >> self.shift, dtype=np.uint16) if self.shift else image


EIGHT_BIT: Final = GrayScale()


def gray_scale(images: Iterable[Grey], bits: int | None) -> GrayScale:
    """Find the gray scale of images at rest, one after the other; `bits` as stated, or None.

    Without a statement it follows from all images together: where they leave the lowest bits empty,
    the others are the camera's; else it is the usual depth next above the brightest pixel. Raises
    InputError where the images contradict each other, or what is stated.
    """
    held, kinds = 0, set()
    for image in images:
        kinds.add(image.dtype)
        held |= _bits_held(image)
    if len(kinds) != 1:
        raise InputError("some images at rest have 8 bits and some 16, allowed is one depth")
    if kinds == {np.dtype(np.uint8)}:
        if bits not in (None, 8):
            raise InputError(f"the images at rest have 8 bits, camera.bits in rig.json is {bits}")
        return EIGHT_BIT
    empty = (held & -held).bit_length() - 1 if held else 0
    upper = 16 - min(empty, 8)
    if bits is None:
        if empty and upper in _USUAL:
            return GrayScale(upper, 16 - upper)
        return GrayScale(next(usual for usual in _USUAL if held < 2**usual))
    if upper <= bits:
        return GrayScale(bits, 16 - bits)
    if held < 2**bits:
        return GrayScale(bits)
    raise InputError(
        f"the images at rest have gray values in more than the lower or the upper {bits} of 16 "
        f"bits, camera.bits in rig.json is {bits}"
    )


def _bits_held(image: Grey) -> int:
    """The bits that are set in any pixel."""
    return int(np.bitwise_or.reduce(image, axis=None)) if image.size else 0
