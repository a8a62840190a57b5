"""Damage to the bytes of a file: flips, truncations, insertions, encodings."""

import random
from collections.abc import Callable, Sequence
from typing import Final

# Chosen: bytes that end texts, start escapes, or have a meaning in several formats.
_ODD: Final = (
    *(b"\0", b"\xff", b"\xef\xbb\xbf", b"\r", b"\n\n", b'"', b"'", b",", b";", b"\t", b"\x1b[31m"),
    *(b"\xe2\x80\xae", b"\xed\xa0\x80", b"%s%n", b"../../", b"\x85", b"\xe2\x80\xa8", b"=1+1"),
)
_ENCODINGS: Final = ("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "cp500", "utf-7")


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Damage a file's content in one to three ways."""
    for _ in range(chance.randint(1, 3)):
        data = chance.choice(_DAMAGES)(data, chance)
    return data


def _flipped(data: bytes, chance: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 8, 64)) if data else 0):
        changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _truncated(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.choice((0, 1, chance.randrange(len(data) + 1), max(len(data) - 1, 0)))]


def _inserted(data: bytes, chance: random.Random) -> bytes:
    at = chance.choice((0, len(data), chance.randrange(len(data) + 1)))
    return data[:at] + chance.choice(_ODD) * chance.choice((1, 1, 1, 1000)) + data[at:]


def _removed(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    return data[:at] + data[at + chance.choice((1, 4, 100)) :]


def _overwritten(data: bytes, chance: random.Random) -> bytes:
    """Overwrite a few bytes, such as a length, with all zeros, all ones or a large number."""
    at, size = chance.randrange(len(data) + 1), chance.choice((1, 2, 4, 8))
    filling = chance.choice((b"\0", b"\xff", b"\x7f", b"\x80")) * size
    return data[:at] + filling + data[at + size :]


def _repeated(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    part = data[at : at + chance.choice((1, 20, 200))]
    return data[:at] + part * chance.choice((2, 3, 500)) + data[at:]


def _encoded(data: bytes, chance: random.Random) -> bytes:
    encoding = chance.choice(_ENCODINGS)
    return data.decode("utf-8", errors="replace").encode(encoding, errors="replace")


def _line_ends(data: bytes, chance: random.Random) -> bytes:
    return data.replace(b"\n", chance.choice((b"\r\n", b"\r", b"\n\r", b"")))


_DAMAGES: Final[Sequence[Callable[[bytes, random.Random], bytes]]] = (
    *(_flipped, _truncated, _inserted, _removed, _overwritten, _repeated, _encoded, _line_ends),
)
