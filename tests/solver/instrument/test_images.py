import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.images import (
    FORMATS,
    eight_bit,
    image_files,
    image_head,
    png_bytes,
    read_grey,
    to_grey,
)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_gray_values_survive_a_file(tmp_path: Path, bits: int, random: np.random.Generator) -> None:
    kind = np.uint8 if bits == 8 else np.uint16
    image: Grey = random.integers(0, 2**bits, (30, 41)).astype(kind)
    image[0, :2] = 0, 2**bits - 1
    path = tmp_path / "image.png"
    path.write_bytes(png_bytes(image))
    back = read_grey(path)
    assert back.dtype == kind
    assert (back == image).all()
    assert image_head(path) == (41, 30, 8 if bits == 8 else 16)


def test_the_same_image_gives_the_same_bytes(random: np.random.Generator) -> None:
    image = random.integers(0, 4096, (30, 41), dtype=np.uint16)
    assert png_bytes(image) == png_bytes(image.copy())


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_colour_becomes_gray_and_bits_stay(
    kind: type, channels: int, tmp_path: Path, random: np.random.Generator
) -> None:
    grey: Grey = random.integers(0, np.iinfo(kind).max, (7, 9)).astype(kind)
    coloured = np.repeat(grey[:, :, None], channels, axis=2)
    found = to_grey(coloured, "x")
    assert found.dtype == kind
    assert np.array_equal(found, grey)  # the weights of the three colours add up to one
    path = tmp_path / "x.png"
    path.write_bytes(bytes(cv2.imencode(".png", coloured)[1]))
    assert np.array_equal(read_grey(path), grey)


def test_a_file_keeps_blue_and_red_apart(tmp_path: Path) -> None:
    path = tmp_path / "x.png"
    for place, gray in enumerate((29, 150, 76)):  # blue, green, red (ITU-R BT.601)
        one = np.zeros((4, 5, 3), np.uint8)
        one[:, :, place] = 255
        path.write_bytes(bytes(cv2.imencode(".png", one)[1]))
        assert (read_grey(path) == gray).all()


def test_a_channel_of_a_colour_image() -> None:
    wood, paper = (40, 110, 160), (200, 200, 200)  # blue, green, red
    image = np.array([[wood, paper]], np.uint8)
    assert [to_grey(image, "x", one)[0, 0] for one in "bgr"] == list(wood)
    # Neutral is 128 of CIELAB's b, yellow is above it.
    yellow, neutral = to_grey(image, "x", "lab_b")[0]
    assert neutral == 128
    assert yellow > 160
    with_opacity = np.dstack([image, np.full((1, 2), 255, np.uint8)])
    assert np.array_equal(to_grey(with_opacity, "x", "lab_b"), to_grey(image, "x", "lab_b"))
    deep = image.astype(np.uint16) * 257
    assert (to_grey(deep, "x", "r") == deep[:, :, 2]).all()
    with pytest.raises(InputError, match="x: has 16 bits, the channel lab_b needs 8 bits"):
        to_grey(deep, "x", "lab_b")
    assert to_grey(image[:, :, 0], "x", "r") is not None  # what is gray already stays as it is


def test_a_telephone_s_heic_image_has_a_remedy(tmp_path: Path) -> None:
    path = tmp_path / "IMG_1.HEIC"
    path.write_bytes(b"\x00\x00\x00\x20ftypheic\x00\x00\x00\x00")
    with pytest.raises(InputError, match=r"heif-convert -q 95 'IMG_1.HEIC' 'IMG_1.jpg'"):
        read_grey(path)


def test_what_is_neither_gray_nor_colour_is_refused() -> None:
    with pytest.raises(InputError, match=r"x: has shape \(3, 3\) and type float64"):
        to_grey(np.zeros((3, 3)), "x")
    with pytest.raises(InputError, match="allowed are gray or colour"):
        to_grey(np.zeros((3, 3, 2), np.uint8), "x")


@pytest.mark.parametrize("content", [b"", b"no image"])
def test_what_is_no_image_is_said(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "image.png"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not an image that can be decoded"):
        read_grey(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_grey(tmp_path / "absent.png")


def test_a_deep_image_is_shown_in_eight_bits() -> None:
    deep = np.array([[0, 1000, 2000]], np.uint16)
    assert eight_bit(deep).tolist() == [[0, 128, 255]]
    assert eight_bit(deep).dtype == np.uint8
    assert not eight_bit(np.zeros((2, 2), np.uint16)).any()
    shallow = np.array([[0, 100]], np.uint8)
    assert eight_bit(shallow) is shallow


def test_the_size_in_the_header_of_any_format_is_checked_before_decoding() -> None:
    head = struct.pack("<IIIIiiHHIIiiII", 54, 0, 54, 40, 20_000, 20_000, 1, 24, *[0] * 6)
    with pytest.raises(cv2.error, match="pixels"):  # 1.2 GB in colour
        cv2.imdecode(np.frombuffer(b"BM" + head, np.uint8), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize("suffix", FORMATS)
def test_size_and_depth_of_every_format(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"view_00{suffix}"
    cv2.imwrite(str(path), np.full((30, 41), 90, np.uint8))
    (tmp_path / "view_00.txt").write_text("no image")
    (tmp_path / f"rest_00{suffix}").write_text("another")
    assert image_head(path) == (41, 30, 8)
    assert image_files(tmp_path, "view_") == [path]


def test_a_film_is_no_image(tmp_path: Path) -> None:
    path = tmp_path / "film.tif"
    cv2.imwritemulti(str(path), [np.full((4, 5), one, np.uint8) for one in (1, 2, 3)])
    with pytest.raises(InputError, match=r"film\.tif: holds 3 images, allowed is one; solve such"):
        read_grey(path)
