"""Reading and writing of gray images: colour is converted to gray, the bit depth is kept."""

import struct
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument import MAX_PIXELS
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.files import open_regular
from solver.instrument.hashes import read_bytes

if not hasattr(cv2, "IMWRITE_PNG_FILTER"):
    raise InputError(
        f"OpenCV {cv2.__version__} is too old, 4.12 or newer is needed: "
        "pip install --upgrade opencv-contrib-python-headless"
    )

# Sensor noise cannot be predicted from its neighbours: neither a search for repeats nor a row
# filter reduces the size. For 8 bits these settings take two thirds of the time of OpenCV's
# default, and four fifths of the bytes.
_PNG = [
    cv2.IMWRITE_PNG_STRATEGY,
    cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY,
    cv2.IMWRITE_PNG_FILTER,
    cv2.IMWRITE_PNG_FILTER_NONE,
]
# Largest image file [bytes]. Derived: MAX_PIXELS uncompressed, with four channels of 16 bits.
MAX_BYTES: Final = 8 * MAX_PIXELS
_PNG_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
# Bytes 4 to 12 of a telephone's HEIC image.
_HEIC: Final = (b"ftypheic", b"ftypheix", b"ftypmif1")
_PNG_HEAD: Final = 25  # bytes up to the bit depth
# Formats of a laboratory's images; generated ones are PNG.
FORMATS: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff")
# Formats of which one file may hold a film, as microscopes store it.
STACKS: Final = (".gif", ".tif", ".tiff")
# Channel read from a colour image: luma, one of its colours, or blue to yellow (CIELAB's b).
CHANNELS: Final = ("gray", "r", "g", "b", "lab_b")
# All colours at once, for what compares them.
ALL_CHANNELS: Final = "all"
_CHANNEL_INDEX: Final = {"b": 0, "g": 1, "r": 2}
_TO_GREY: Final = {3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}


def read_grey(path: Path, channel: str = "gray") -> Grey:
    """Read a gray image (height, width) of 8 or 16 bits, as stored in the file.

    From a colour image, `channel`, one of CHANNELS, is read. Pixels are returned in the stored
    order: the orientation tag (EXIF) is ignored, here as in videos. A camera that looks straight
    down cannot detect which way is up, and its tag may change from one image to the next.
    Raises InputError if the file is not an image, or not the one that was generated.
    """
    return to_grey(_read(path), str(path), channel)


def read_channels(path: Path, channel: str) -> Grey:
    """Read an image as `read_grey` does; with ALL_CHANNELS all three of a colour image."""
    return to_channels(_read(path), str(path), channel)


def _read(path: Path) -> Any:
    """Read a file of one image in OpenCV's format. Raises InputError."""
    image = _decode(read_bytes(path, MAX_BYTES), path)
    if path.suffix.lower() in STACKS and (pages := page_count(path)) > 1:
        raise InputError(
            f"{path}: holds {pages} images, allowed is one; solve such a film by itself, as a video"
        )
    return image


def page_count(path: Path) -> int:
    """Count the images of a TIFF or GIF file; 0 if it cannot be read."""
    try:
        return int(cv2.imcount(str(path)))
    except cv2.error:
        return 0


def image_files(folder: Path, start: str = "") -> list[Path]:
    """List the image files of a folder whose names begin with `start`, by name."""
    found = folder.glob(f"{start}*") if folder.is_dir() else ()
    return sorted(path for path in found if path.suffix.lower() in FORMATS)


def decode_grey(content: bytes, path: Path, channel: str = "gray") -> Grey:
    """Decode the bytes of an image file as `read_grey` does; `path` is for messages only.

    Raises InputError if they are not an image.
    """
    return to_grey(_decode(content, path), str(path), channel)


def _decode(content: bytes, path: Path) -> Any:
    """Decode the bytes of an image file to OpenCV's format. Raises InputError."""
    data = np.frombuffer(content, dtype=np.uint8)
    if content.startswith(_PNG_SIGNATURE):
        head = _png_head(content[:_PNG_HEAD], path)
        if head.width * head.height > MAX_PIXELS:  # before memory is allocated for them
            raise InputError(
                f"{path}: has {head.width} x {head.height} px, allowed are {MAX_PIXELS:,} px"
            )
    try:
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:  # such as an image of any format with more than MAX_PIXELS
        image = None
    if image is None and content[4:12] in _HEIC:
        jpeg = path.with_suffix(".jpg").name
        raise InputError(
            f"{path}: is a HEIC image, which cannot be decoded; convert it: heif-convert -q 95 "
            f"'{path.name}' '{jpeg}'"
        )
    if image is None:
        raise InputError(f"{path}: is not an image that can be decoded")
    return image


def to_grey(image: Any, name: str, channel: str = "gray") -> Grey:
    """Convert an image in OpenCV's format (gray, BGR or BGRA) to gray (height, width).

    `channel` is one of CHANNELS; an image that is already gray is not changed. Raises InputError.
    """
    channels = {2: 1, 3: image.shape[-1]}.get(image.ndim) if image.ndim else None
    if image.dtype not in (np.uint8, np.uint16) or channels not in (1, *_TO_GREY):
        raise InputError(
            f"{name}: has shape {image.shape} and type {image.dtype}, "
            "allowed are gray or colour of 8 or 16 bits"
        )
    if channels == 1:
        return np.asarray(image.reshape(image.shape[:2]))
    if channel in _CHANNEL_INDEX:
        return np.ascontiguousarray(image[:, :, _CHANNEL_INDEX[channel]])
    if channel == "lab_b":
        if image.dtype != np.uint8:
            raise InputError(f"{name}: has 16 bits, the channel lab_b needs 8 bits")
        lab = cv2.cvtColor(np.ascontiguousarray(image[:, :, :3]), cv2.COLOR_BGR2LAB)
        return np.ascontiguousarray(lab[:, :, 2])
    return np.asarray(cv2.cvtColor(image, _TO_GREY[channels]))


def to_channels(image: Any, name: str, channel: str) -> Grey:
    """Convert an image in OpenCV's format as `to_grey` does; with ALL_CHANNELS keep its colours.

    A colour image is then (height, width, 3), in the order blue, green, red, without transparency.
    """
    colours = image.ndim == 3 and image.shape[2] in _TO_GREY
    if channel != ALL_CHANNELS or not colours or image.dtype not in (np.uint8, np.uint16):
        return to_grey(image, name, "gray" if channel == ALL_CHANNELS else channel)
    return np.ascontiguousarray(image[:, :, :3])


def eight_bit(image: Grey) -> npt.NDArray[np.uint8]:
    """Convert an image to 8 bits, for display and for detectors that accept only 8 bits.

    An image of 8 bits is not changed; a deeper one is scaled so that its brightest pixel is 255.
    """
    if image.dtype == np.uint8:
        return np.asarray(image, dtype=np.uint8)
    scaled = np.rint(image * (255 / max(int(image.max()), 1)))
    return np.asarray(scaled, dtype=np.uint8)


def png_bytes(image: Grey) -> bytes:
    """Encode a gray image (height, width) as PNG; the same image gives the same bytes."""
    ok, data = cv2.imencode(".png", image, _PNG)
    if not ok:
        raise ValueError(f"an image of shape {image.shape} cannot be encoded as PNG")
    return bytes(data)


class ImageHead(NamedTuple):
    """Size of an image in pixels, and its 8 or 16 bits per channel."""

    width: int
    height: int
    bits: int


def image_head(path: Path) -> ImageHead:
    """Read the size and depth of an image file; of a PNG from its first bytes only.

    Raises InputError.
    """
    try:
        with open_regular(path) as stream:
            head = stream.read(_PNG_HEAD)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if head.startswith(_PNG_SIGNATURE):
        return _png_head(head, path)
    image = read_grey(path)
    return ImageHead(image.shape[1], image.shape[0], 8 * image.itemsize)


def _png_head(head: bytes, path: Path) -> ImageHead:
    if len(head) < _PNG_HEAD:
        raise InputError(f"{path}: is not an image that can be decoded")
    width, height, bits = struct.unpack(">IIB", head[16:])
    return ImageHead(width, height, 16 if bits == 16 else 8)
