"""Writer and reader of truth images as OpenEXR: one part, ZIP, dotted layer names."""

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from solver.instrument.files import write_bytes
from vbaa_bench.dataset.exr_channels import channels

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
