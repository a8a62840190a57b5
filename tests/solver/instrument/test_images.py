from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.images import eight_bit, png_bytes, png_size, read_grey


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_gray_values_survive_a_file(tmp_path: Path, bits: int) -> None:
    kind = np.uint8 if bits == 8 else np.uint16
    image: Grey = np.random.default_rng(0).integers(0, 2**bits, (30, 41)).astype(kind)
    image[0, :2] = 0, 2**bits - 1
    path = tmp_path / "image.png"
    path.write_bytes(png_bytes(image))
    back = read_grey(path)
    assert back.dtype == kind
    assert (back == image).all()
    assert png_size(path) == (41, 30)


def test_the_same_image_gives_the_same_bytes() -> None:
    image = np.random.default_rng(0).integers(0, 4096, (30, 41), dtype=np.uint16)
    assert png_bytes(image) == png_bytes(image.copy())


@pytest.mark.parametrize("wrong", [np.zeros((4, 5, 3), np.uint8), np.zeros((4, 5, 4), np.uint16)])
def test_only_one_channel_is_gray(tmp_path: Path, wrong: np.ndarray) -> None:
    path = tmp_path / "image.png"
    path.write_bytes(bytes(cv2.imencode(".png", wrong)[1]))
    with pytest.raises(InputError, match="allowed is one channel of 8 or 16 bits"):
        read_grey(path)


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
