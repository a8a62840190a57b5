"""Bit depth of a camera's gray values, and their position within 16 bits."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError

# Bit depths of industrial cameras (GenICam's Mono8 to Mono16).
_USUAL_DEPTHS: Final = (8, 10, 12, 14, 16)


@dataclass(frozen=True)
class GrayScale:
    """Gray scale of `bits` bits, stored `shift` bits above the lowest bit of the file's values."""

    bits: int = 8
    shift: int = 0

    @property
    def full_scale(self) -> int:
        """Gray value of a saturated pixel."""
        return int(2**self.bits - 1)

    def __call__(self, image: Grey) -> Grey:
        """Shift an image (height, width) to gray values from 0 to `full_scale`.

        Raises InputError if it has other values, which means that it was not stored as the rest
        images were.
        """
        if image.dtype == np.uint8:
            if self.bits == 8:
                return image
            raise InputError(f"the image has 8 bits, the images at rest have {self.bits}")
        used = _used_bits(image)
        if used >> self.shift > self.full_scale or used & (2**self.shift - 1):
            position = "upper" if self.shift else "lower"
            raise InputError(
                f"the image has gray values up to {int(image.max())}, which are not in the "
                f"{position} {self.bits} of its 16 bits as in the rest images: store all images "
                "alike, or set camera.bits in rig.json"
            )
        return np.asarray(image >> self.shift, dtype=np.uint16) if self.shift else image


EIGHT_BIT: Final = GrayScale()


def gray_scale(images: Iterable[Grey], bits: int | None) -> GrayScale:
    """Find the gray scale of the rest images; `bits` is the stated depth, or None.

    Without a stated depth it follows from all images together: if their lowest bits are zero, the
    other bits are the camera's; otherwise it is the smallest usual depth that holds the brightest
    pixel. Raises InputError if the images contradict each other or the stated depth.
    """
    used, dtypes = 0, set()
    for image in images:
        dtypes.add(image.dtype)
        used |= _used_bits(image)
    if len(dtypes) != 1:
        raise InputError("some images at rest have 8 bits and some 16, allowed is one depth")
    if dtypes == {np.dtype(np.uint8)}:
        if bits not in (None, 8):
            raise InputError(f"the images at rest have 8 bits, camera.bits in rig.json is {bits}")
        return EIGHT_BIT
    zero_bits = (used & -used).bit_length() - 1 if used else 0
    upper = 16 - min(zero_bits, 8)
    if bits is None:
        if zero_bits and upper in _USUAL_DEPTHS:
            return GrayScale(upper, 16 - upper)
        return GrayScale(next(depth for depth in _USUAL_DEPTHS if used < 2**depth))
    if upper <= bits:
        return GrayScale(bits, 16 - bits)
    if used < 2**bits:
        return GrayScale(bits)
    raise InputError(
        f"the images at rest have gray values in more than the lower or the upper {bits} of 16 "
        f"bits, camera.bits in rig.json is {bits}"
    )


def _used_bits(image: Grey) -> int:
    """Return the bits that are set in any pixel, as a mask."""
    return int(np.bitwise_or.reduce(image, axis=None)) if image.size else 0
