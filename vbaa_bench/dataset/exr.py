"""Truth images as OpenEXR: one part, ZIP, dotted layer names."""

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from solver.instrument.files import write_bytes
from vbaa_bench.openexr import channels

# layer of a scene -> (channels, pixel type): half where eleven bits suffice, full where not.
# Radiance is that of the scene; the lens's vignetting comes after it.
CHANNELS = {
    "radiance": (("radiance.Y",), np.float16),
    "variance": (("variance.Y",), np.float32),
    "beam_mask": (("beam.mask",), np.float16),
    "coverage": (("beam.coverage",), np.float16),
    "arc_length": (("beam.arc_length_mm",), np.float32),
    "depth": (("depth.z_mm",), np.float32),
    "normal": (("normal.X", "normal.Y", "normal.Z"), np.float16),
    "object_index": (("object.index",), np.uint32),
    "occlusion": (("beam.occlusion",), np.float16),
}


def exr_bytes(layers: Mapping[str, np.ndarray]) -> bytes:
    """Encode layers (height, width), or (height, width, 3) of vectors, keyed as in CHANNELS."""
    written = {}
    for layer, values in layers.items():
        names, kind = CHANNELS[layer]
        for name, part in zip(names, np.atleast_3d(values).transpose(2, 0, 1), strict=True):
            # OpenEXR writes strided arrays wrong without an error: copy to contiguous memory.
            values_of = np.ascontiguousarray(part, dtype=kind)
            written[name] = _sixteen_bits(values_of) if layer == "depth" else values_of
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    # Encoded in memory: its hash is that of these bytes, and a full disk is an OSError.
    stream = io.BytesIO()
    with OpenEXR.File(header, written) as file:
        file.write(stream)
    return stream.getvalue()


def write_exr(path: Path, layers: Mapping[str, np.ndarray]) -> None:
    """Write layers as `exr_bytes` takes them. Raises OSError."""
    write_bytes(path, exr_bytes(layers))


def _sixteen_bits(values: np.ndarray) -> np.ndarray:
    """Floats rounded to sixteen significant bits, a 65,000th: files are smaller by a quarter."""
    bits = values.view(np.uint32) + np.uint32(0x80)
    return (bits & np.uint32(0xFFFFFF00)).view(np.float32)


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """Read the layers of a truth image, as `exr_bytes` takes them. Raises InputError."""
    found = channels(path)
    return {
        layer: np.dstack([found[name] for name in names]).squeeze()
        for layer, (names, _) in CHANNELS.items()
        if names[0] in found
    }
