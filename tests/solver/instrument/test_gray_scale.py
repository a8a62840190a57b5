"""Bits of gray values: stated, or from all images at rest, and the same for every frame."""

import numpy as np
import pytest

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.gray_scale import GrayScale, gray_scale
from tests.draws import generator


def image(bits: int, brightest: float = 0.9, shift: int = 0, seed: int = 0) -> Grey:
    """Noise up to a share of the full scale of `bits` bits, in 8 or 16."""
    values = generator(__name__, seed).integers(0, int(brightest * 2**bits), (40, 60))
    return (values << shift).astype(np.uint8 if bits + shift == 8 else np.uint16)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_the_upper_bits_are_told_from_the_lower(bits: int) -> None:
    lower, upper = image(bits).astype(np.uint16), image(bits, 0.3, 16 - bits).astype(np.uint16)
    for told in (None, bits):
        for one in (lower, upper):
            scale = gray_scale([one], told)
            assert scale.bits == bits
            assert scale.full_scale == 2**bits - 1
        assert np.array_equal(gray_scale([upper], told)(upper), image(bits, 0.3))


def test_a_dim_image_has_the_bits_that_are_stated() -> None:
    dim = image(12, 0.1)
    assert gray_scale([dim], 12) == GrayScale(12)
    assert gray_scale([dim, image(12)], None) == GrayScale(12)  # all of them together
    # Alone and without a statement it is taken for 10 bits; the first bright frame says so.
    with pytest.raises(InputError, match=r"not in the lower 10 of its 16 bits.*set camera\.bits"):
        gray_scale([dim], None)(image(12))


def test_eight_bits_are_as_they_are() -> None:
    shallow = image(8)
    assert gray_scale([shallow], None)(shallow) is shallow
    assert np.array_equal(gray_scale([shallow], 8)(shallow.astype(np.uint16)), shallow)
    with pytest.raises(InputError, match=r"gray values up to .* which are not in the lower 8 of"):
        gray_scale([shallow], None)(shallow.astype(np.uint16) * 257)
    with pytest.raises(InputError, match="the image has 8 bits, the images at rest have 12"):
        gray_scale([image(12)], None)(shallow)


@pytest.mark.parametrize(
    ("images", "bits", "said"),
    [
        ([image(8)], 12, "have 8 bits, camera.bits in rig.json is 12"),
        ([image(8), image(12)], None, "some images at rest have 8 bits and some 16"),
        ([image(14)], 12, "more than the lower or the upper 12 of 16 bits"),
        ([image(12, 0.9, 4), image(12)], 10, "more than the lower or the upper 10"),
    ],
)
def test_images_that_contradict_are_refused(images: list[Grey], bits: int, said: str) -> None:
    with pytest.raises(InputError, match=said):
        gray_scale(images, bits)


def test_a_frame_in_other_bits_is_refused() -> None:
    scale = gray_scale([image(12, 0.9, 4)], None)
    with pytest.raises(InputError, match="not in the upper 12 of its 16 bits"):
        scale(image(12))


def test_a_black_image_is_no_reason_to_stop() -> None:
    black = np.zeros((4, 5), np.uint16)
    assert gray_scale([black], None) == GrayScale(8)
    assert gray_scale([black], 12) == GrayScale(12)
    assert not GrayScale(12, 4)(black).any()
