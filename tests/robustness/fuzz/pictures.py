"""Image files of many forms, valid and not: PNG chunks, OpenEXR headers, other formats."""

import random
import struct
import zlib
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Grey
from tests.robustness.fuzz.damage import damaged
from vbaa_bench.dataset.exr import exr_bytes

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_COLOUR_CHANNELS: Final = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_SIDES: Final = (0, 1, 2, 7, 33, 512, 8192, 8193, 65000, 2**20, 2**31 - 1, 2**31, 2**32 - 1)
_FORMATS: Final = (".png", ".jpg", ".bmp", ".tiff", ".pgm", ".webp", ".hdr", ".jp2", ".ppm", ".gif")


def picture(valid: bytes, chance: random.Random) -> bytes:
    """Make an image file: `valid` damaged, or one of odd form."""
    kind = chance.randrange(8)
    if kind == 0:
        return damaged(valid, chance)
    if kind in (1, 2):
        return png_with(valid, chance)
    if kind == 3:
        return any_png(chance)
    if kind == 4:
        return bomb(chance)
    if kind == 5:
        data = other_format(chance)
        return damaged(data, chance) if chance.random() < 0.5 else data
    if kind == 6:
        data = exr(chance)
        return damaged(data, chance) if chance.random() < 0.7 else data
    return chance.choice((b"", b"x", valid, valid * 2, chance.randbytes(300)))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_with(valid: bytes, chance: random.Random) -> bytes:
    """Change the header of a PNG, with a right checksum, or add, repeat or remove a chunk."""
    chunks = _chunks(valid)
    if not chunks:
        return damaged(valid, chance)
    if chance.random() < 0.6:
        width, height, depth, colour, *rest = struct.unpack(">IIBBBBB", chunks[0][1])
        field = chance.randrange(4)
        width = chance.choice(_SIDES) if field == 0 else width
        height = chance.choice(_SIDES) if field in (0, 1) else height
        depth = chance.choice((0, 1, 2, 4, 8, 16, 255)) if field == 2 else depth
        colour = chance.choice((0, 2, 3, 4, 6, 7)) if field == 3 else colour
        rest = [chance.choice((0, 0, 1, 255)) for _ in rest]
        chunks[0] = (b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, *rest))
    else:
        name = chance.choice(
            (b"PLTE", b"tRNS", b"gAMA", b"iCCP", b"eXIf", b"tEXt", b"zTXt", b"acTL")
        )
        name = chance.choice((name, name, b"IDAT", b"IHDR", b"ABCD"))
        content = chance.choice((b"", chance.randbytes(12), b"a\0" + zlib.compress(b"0" * 10**6)))
        chunks.insert(chance.randrange(len(chunks) + 1), (name, content))
        if chance.random() < 0.3:
            del chunks[chance.randrange(len(chunks))]
    return _SIGNATURE + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """Split a valid PNG into its chunks."""
    chunks, at = [], len(_SIGNATURE)
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4])
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 12 + size
    return chunks


def any_png(chance: random.Random) -> bytes:
    """Make a small PNG of any depth, colour type and interlacing, with valid checksums."""
    width, height = chance.choice((1, 2, 9, 40)), chance.choice((1, 3, 30))
    depth, colour = chance.choice((1, 2, 4, 8, 16)), chance.choice(tuple(_COLOUR_CHANNELS))
    interlaced = chance.randrange(2)
    row = (width * depth * _COLOUR_CHANNELS[colour] + 7) // 8
    rows = b"".join(bytes([chance.randrange(6)]) + chance.randbytes(row) for _ in range(height))
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlaced)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    if colour == 3:
        chunks.insert(1, (b"PLTE", chance.randbytes(3 * chance.choice((1, 2, 16, 256)))))
    return _SIGNATURE + b"".join(_chunk(*chunk) for chunk in chunks)


def bomb(chance: random.Random) -> bytes:
    """Make a file of a few kB that claims, or holds, very many pixels."""
    kind = chance.randrange(6)
    side = chance.choice((4000, 14000, 30000, 60000, 65000, 65535))
    if kind == 0:
        head = struct.pack(">IIBBBBB", side, side, chance.choice((1, 8, 16)), 0, 0, 0, 0)
        data = zlib.compress(b"\0" * min((side + 1) * side, 2 * 10**7), 9)
        return _SIGNATURE + _chunk(b"IHDR", head) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")
    if kind == 1:
        data = b"BM" + struct.pack("<IIIIiiHHIIiiII", 54, 0, 54, 40, side, side, 1, 24, *[0] * 6)
        return data + b"\0" * 100
    if kind == 2:
        return f"P5\n{side} {side}\n255\n".encode() + b"\0" * 100
    if kind == 3:
        image = np.zeros((8, 8), np.uint8)
        encoded = bytes(cv2.imencode(".jpg", image)[1])
        at = encoded.find(b"\xff\xc0") + 5
        return encoded[:at] + struct.pack(">HH", side, side) + encoded[at + 4 :]
    if kind == 4:
        text = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {side} +X {side}\n"
        return text.encode() + b"\0" * 100
    return exr_claiming(side, side)


def other_format(chance: random.Random) -> bytes:
    """Encode a small image in another format, of any depth and number of channels."""
    generator = np.random.default_rng(chance.randrange(2**32))
    channels = chance.choice((1, 3, 4))
    dtype = chance.choice((np.uint8, np.uint16, np.float32))
    image: Grey = generator.integers(0, 255, (9, 14, channels)).astype(dtype)
    try:
        encoded, data = cv2.imencode(chance.choice(_FORMATS), image)
    except cv2.error:
        return b"not an image"
    return bytes(data) if encoded else b"not an image"


def exr(chance: random.Random) -> bytes:
    """Encode a small OpenEXR image with layers of the truth."""
    values = np.linspace(0.1, 3, 12 * 17).reshape(12, 17) * chance.choice(
        (1, 1, -1, np.nan, np.inf)
    )
    layers = chance.choice((("radiance",), ("depth",), ("radiance", "beam_mask")))
    return exr_bytes(dict.fromkeys(layers, values))


def exr_claiming(width: int, height: int) -> bytes:
    """Make an OpenEXR file whose header claims a size."""
    data = exr_bytes({"depth": np.ones((4, 4))})
    size = struct.pack("<iiii", 0, 0, 3, 3)
    return data.replace(size, struct.pack("<iiii", 0, 0, width - 1, height - 1))
