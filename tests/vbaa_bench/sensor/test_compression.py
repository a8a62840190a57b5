import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.draws import generator
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.sensor.compression import jpeg
from vbaa_bench.sensor.from_spec import image_sensor


@pytest.mark.parametrize(("quality", "step"), [(50, 2), (10, 10), (95, 2 / 8)])
def test_flat_blocks_are_rounded_to_the_step_of_the_quality(quality: int, step: float) -> None:
    # The mean of a block is quantised in steps of an eighth of the first entry of the luminance
    # table (ITU-T T.81, annex K): 16 at quality 50, 80 at 10 and 2 at 95.
    levels = np.arange(0, 256, 3)
    image = np.kron(levels[None], np.ones((8, 8))).astype(np.uint8)
    decoded = jpeg(image, quality).astype(float)
    assert np.abs(decoded - image).max() <= step / 2 + 0.5
    exact = np.clip(128 + step * np.rint((levels - 128) / step), 0, 255)
    halfway = np.isclose((levels - 128) / step % 1, 0.5)
    assert decoded[0, ::8][~halfway] == pytest.approx(exact[~halfway], abs=0.5)


@given(st.integers(0, 2**32), st.integers(1, 100), st.integers(1, 40), st.integers(1, 40))
def test_the_same_image_gives_the_same_bytes(
    seed: int, quality: int, height: int, width: int
) -> None:
    image = generator(__name__, seed).integers(0, 256, (height, width)).astype(np.uint8)
    decoded = jpeg(image, quality)
    assert decoded.shape == image.shape
    assert decoded.dtype == np.uint8
    assert (decoded == jpeg(image.copy(), quality)).all()
    parameters = [cv2.IMWRITE_JPEG_QUALITY, quality]
    one, other = (cv2.imencode(".jpg", each, parameters)[1] for each in (image, image.copy()))
    assert bytes(one) == bytes(other)


def test_frames_are_compressed_after_their_noise() -> None:
    radiance = np.tile(np.linspace(0.1, 0.9, 64), (48, 1))
    plain, compressed = (
        image_sensor(SensorSpec(jpeg_quality=quality), 10_000.0).expose(
            radiance, generator(__name__, 3)
        )
        for quality in (None, 60)
    )
    assert (compressed == jpeg(plain, 60)).all()
    assert (compressed != plain).any()
