"""Random numbers of a scene: one stream for each purpose and frame, independent of the others."""

import hashlib

import numpy as np

from vbaa_bench.scene.schema import Scene


def random_generator(scene: Scene, stream: str, index: int = 0) -> np.random.Generator:
    """Make the generator of one random stream of one frame, independent of all other draws."""
    key = hashlib.blake2b(stream.encode()).digest()[:8]
    return np.random.default_rng([scene.seed, index, int.from_bytes(key)])


def render_seed(scene: Scene, stream: str, index: int = 0) -> int:
    """Derive a 32-bit seed for the renderer in the same way."""
    return int(random_generator(scene, stream, index).integers(2**32))
