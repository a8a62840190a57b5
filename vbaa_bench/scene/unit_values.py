"""Random numbers from 0 to 1, each a function of seed, key and number of the draw alone."""

import functools
import hashlib
from typing import Final, Literal, NamedTuple

import numpy as np

Method = Literal["uniform", "sobol"]
_MASK: Final = 2**32 - 1


class Draw(NamedTuple):
    """One draw of all random keys of a level: its stream, its number, and its attempt.

    Attempts after the first, 0, replace draws that were rejected.
    """

    stream: str
    number: int
    attempt: int = 0


def unit_value(seed: int, method: Method, draw: Draw, key: str) -> float:
    """Return the number in [0, 1) of a random key for one draw.

    It depends on no other key and not on the number of draws, so that a set can grow. With method
    sobol, the first 2^m draws of a key have one value in each of 2^m equal intervals; repeated
    attempts are uniform.
    """
    name = _number(f"{draw.stream} {key}")
    if method == "uniform" or draw.attempt > 0:
        return float(np.random.default_rng([seed, draw.number, name, draw.attempt]).random())
    return _stratified(draw.number & _MASK, *_scrambling(seed, name))


@functools.lru_cache(maxsize=1024)  # chosen: more keys than a scene has
def _scrambling(seed: int, name: int) -> tuple[int, int]:
    """Return the numbers that shuffle and scramble the sequence of a key."""
    shuffle, scramble = np.random.default_rng([seed, name]).integers(2**32, size=2).tolist()
    return shuffle, scramble


def _stratified(index: int, shuffle: int, scramble: int) -> float:
    """Return a point of the van der Corput sequence, Owen-scrambled, at a shuffled index.

    The first dimension of a Sobol sequence. Shuffling the index makes two keys independent (padding
    of Burley, "Practical Hash-based Owen Scrambling", JCGT 2020, sections 4 and 5).
    """
    shuffled = _reversed_bits(_permuted(_reversed_bits(index), shuffle))
    return _reversed_bits(_permuted(shuffled, scramble)) / 2**32


def _permuted(bits: int, seed: int) -> int:
    """Permute 32-bit numbers so that each bit depends only on lower bits (Laine, Karras 2011)."""
    bits = (bits + seed) & _MASK
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        bits ^= (bits * factor) & _MASK
    return bits


def _reversed_bits(bits: int) -> int:
    return int(f"{bits:032b}"[::-1], 2)


@functools.lru_cache(maxsize=1024)
def _number(name: str) -> int:
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest())
