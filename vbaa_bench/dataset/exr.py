"""Truth images as OpenEXR: one part, ZIP, dotted layer names."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from solver.instrument.errors import InputError

# layer of a scene -> (channel, pixel type): half where eleven bits suffice, full where they do not
CHANNELS = {
    "radiance": ("radiance.Y", np.float16),
    "beam_mask": ("beam.mask", np.float16),
    "arc_length": ("beam.arc_length_mm", np.float32),
    "depth": ("depth.z_mm", np.float32),
    "object_index": ("object.index", np.uint32),
}


def write_exr(path: Path, layers: Mapping[str, np.ndarray]) -> None:
    """Write layers (height, width), keyed as in CHANNELS."""
    channels = {}
    for layer, values in layers.items():
        name, kind = CHANNELS[layer]
        # OpenEXR writes strided arrays wrong without an error: copy to contiguous memory.
        channels[name] = np.ascontiguousarray(values, dtype=kind)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """Layers (height, width) of a truth image, keyed as in CHANNELS. Raises InputError."""
    try:
        file = OpenEXR.File(str(path), separate_channels=True)
    except Exception as error:
        raise InputError(f"{path}: is not an EXR image that can be read ({error})") from error
    with file:
        if not file.parts:
            raise InputError(f"{path}: is a truncated EXR image")
        found = file.channels()
        return {
            layer: np.array(found[name].pixels)
            for layer, (name, _) in CHANNELS.items()
            if name in found
        }
