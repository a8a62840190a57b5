"""Random numbers of the tests: all depend on one seed, which `make seeds` changes.

A test that passes with one seed may have passed by luck. Whatever a test draws therefore comes from
here: from the fixture `random` or, where it is drawn elsewhere, `generator`; the seed of a scene or
of another library's numbers from `scene_seed`.
"""

import os
import re
import zlib
from typing import Final

import numpy as np

SEED: Final = int(os.environ.get("VBAA_TEST_SEED", "0"))


def generator(name: str, *numbers: int) -> np.random.Generator:
    """Return the random generator of a name and numbers, another one for each seed of the run.

    Equal names and numbers give equal random numbers. A module's own name avoids those of others.
    """
    return np.random.default_rng([SEED, zlib.crc32(name.encode()), *numbers])


def seeded(text: str) -> str:
    """Return the text of a scene, whose seed is that of `scene_seed`."""
    return re.sub(r"(?m)^seed: (\d+)$", lambda seed: f"seed: {scene_seed(int(seed[1]))}", text)


def scene_seed(seed: int) -> int:
    """Return a scene's seed: the stated one in run 0, another one for each seed of the run."""
    return seed + 10_000 * SEED
