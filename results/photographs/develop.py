"""A phone's development of a colour photograph: noise, exposure, the curve of sRGB and JPEG."""

import cv2
import numpy as np

from solver.instrument.arrays import Floats

# Encoded values that the median and the brightest thousandth of the pixels have at most. Chosen, as
# the automatic exposure of a phone.
_MEDIAN, _BRIGHTEST = 0.5, 0.95
_QUANTILES = (0.5, 0.999)
# Electrons of a pixel at full scale, and of its read noise. Chosen: a small pixel in daylight.
_FULL_WELL, _READ_NOISE = 4000.0, 5.0


def developed(radiance: Floats, blur_px: float, random: np.random.Generator) -> np.ndarray:
    """Develop a radiance (height, width, 3), red first, to 8 bits in sRGB, blue first.

    The lens blurs with a Gaussian of `blur_px`; shot noise and read noise are added to the light.
    """
    blurred = cv2.GaussianBlur(radiance, (0, 0), blur_px) if blur_px > 0 else radiance
    median, brightest = np.quantile(blurred.max(axis=2), _QUANTILES)
    exposure = min(decoded(_MEDIAN) / median, decoded(_BRIGHTEST) / brightest)
    electrons = np.maximum(exposure * blurred * _FULL_WELL, 0.0)
    sigma = np.sqrt(electrons + _READ_NOISE**2)
    electrons = electrons + sigma * random.standard_normal(electrons.shape)
    linear = np.clip(electrons / _FULL_WELL, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * encoded).astype(np.uint8)[:, :, ::-1])


def decoded(encoded: float) -> float:
    """Convert an encoded value above 0.04 of sRGB to its linear one."""
    return float(((encoded + 0.055) / 1.055) ** 2.4)


def colour_jpeg(image: np.ndarray, quality: int) -> bytes:
    """Encode an image (height, width, 3), blue first, as baseline JPEG; quality is 1 to 100."""
    success, data = cv2.imencode(
        ".jpg", np.ascontiguousarray(image), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    assert success
    return bytes(data)
