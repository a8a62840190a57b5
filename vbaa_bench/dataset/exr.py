"""OpenEXR files: truth images, of one part, with ZIP and dotted layer names; and those of users."""

import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import OpenEXR

from solver.instrument.errors import InputError, truncated
from solver.instrument.files import write_bytes
from solver.instrument.hashes import read_bytes

# Largest number of values. Derived: 16 channels of the largest scene, 8192 x 8192 px.
MAX_VALUES: Final = 1 << 30

# Layer of a scene -> (channels, pixel type): half precision if eleven bits and its range, 6e-8 to
# 65,504, suffice, else full. Radiance needs full: it scales with the scene's `irradiance`.
# Radiance does not include the lens's vignetting.
CHANNELS = {
    "radiance": (("radiance.Y",), np.float32),
    "variance": (("variance.Y",), np.float32),
    "beam_mask": (("beam.mask",), np.float16),
    "coverage": (("beam.coverage",), np.float16),
    "arc_length": (("beam.arc_length_mm",), np.float32),
    "depth": (("depth.z_mm",), np.float32),
    "normal": (("normal.X", "normal.Y", "normal.Z"), np.float16),
    "object_index": (("object.index",), np.uint32),
    "occlusion": (("beam.occlusion",), np.float16),
}
# Significant bits kept of a layer; more would double the file size. The relative resolution of
# radiance, 1/2,000, is far below its noise, and its variance has one degree of freedom; that of
# depth is 1/65,000.
_BITS = {"radiance": 11, "variance": 11, "depth": 16}


def exr_bytes(layers: Mapping[str, np.ndarray]) -> bytes:
    """Encode layers (height, width), or (height, width, 3) of vectors, keyed as in CHANNELS."""
    planes = {}
    for layer, values in layers.items():
        names, dtype = CHANNELS[layer]
        for name, part in zip(names, np.atleast_3d(values).transpose(2, 0, 1), strict=True):
            # OpenEXR writes strided arrays wrongly without an error: copy to contiguous memory.
            plane = np.ascontiguousarray(part, dtype=dtype)
            planes[name] = _rounded(plane, _BITS[layer]) if layer in _BITS else plane
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    # Encoded in memory: the hash is of these bytes, and a full disk raises OSError.
    stream = io.BytesIO()
    with OpenEXR.File(header, planes) as file:
        file.write(stream)
    return stream.getvalue()


def write_exr(path: Path, layers: Mapping[str, np.ndarray]) -> None:
    """Write layers in the format of `exr_bytes`. Raises OSError."""
    write_bytes(path, exr_bytes(layers))


def _rounded(values: np.ndarray, bits: int) -> np.ndarray:
    """Round 32-bit floats to the given number of significant bits."""
    dropped = 24 - bits  # of a significand's 24
    mask = np.uint32(2**32 - 2**dropped)
    return ((values.view(np.uint32) + np.uint32(2 ** (dropped - 1))) & mask).view(np.float32)


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """Read the layers of a truth image, in the format of `exr_bytes`. Raises InputError."""
    planes = channels(path)
    return {
        layer: np.dstack([planes[name] for name in names]).squeeze()
        for layer, (names, _) in CHANNELS.items()
        if names[0] in planes
    }


def channels(path: Path, max_values: int = MAX_VALUES) -> dict[str, np.ndarray]:
    """Read every channel (height, width) of a one-part file of at most `max_values` values.

    The size is read from the header, before memory is allocated. Raises InputError.
    """
    return decode_channels(read_bytes(path), path, max_values)


def decode_channels(data: bytes, path: Path, max_values: int) -> dict[str, np.ndarray]:
    """Decode the bytes of a file as `channels` does; `path` is for messages only.

    Raises InputError.
    """
    try:
        with OpenEXR.File(io.BytesIO(data), header_only=True) as head:
            sizes = [_size(part.header) for part in head.parts]
        if sum(sizes) > max_values:
            raise InputError(f"{path}: has {sum(sizes):,} values, allowed are {max_values:,}")
        file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
    except InputError:
        raise
    except Exception as error:
        reason = truncated(str(error))
        raise InputError(f"{path}: is not a readable EXR image ({reason})") from error
    with file:
        if not file.parts:
            raise InputError(f"{path}: is a truncated EXR image")
        return {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}


def _size(header: dict[str, Any]) -> int:
    """Compute the number of values of a part from its header."""
    low, high = header["dataWindow"]
    sides = (int(last) - int(first) + 1 for first, last in zip(low, high, strict=True))
    return math.prod(sides) * len(header["channels"])
