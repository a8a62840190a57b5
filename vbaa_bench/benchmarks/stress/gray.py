"""Perturbations of gray values: compression, processing, tone curves, flicker, colour."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Grey
from vbaa_bench.benchmarks.stress.recording import Perturbation, Recording, requantised
from vbaa_bench.sensor.compression import jpeg

# Strength of a phone's processing, chosen by eye. Stronger processing removes the beam's own
# texture; weaker processing is not visible.
_DENOISE_H: Final = 5.0
_SHARPEN_SIGMA_PX: Final = 1.5
_SHARPEN_AMOUNT: Final = 0.8
# A colour camera's sensitivity to a lamp in its blue, green and red pixels, relative to green.
_CHANNELS: Final = (0.6, 1.0, 0.75)


def compressed(quality: int) -> Perturbation:
    """Compress all images as JPEG, those of the board too."""
    return lambda recording, _random: recording.each(lambda image: jpeg(image, quality))


def phone(recording: Recording, _random: np.random.Generator) -> Recording:
    """Denoise, sharpen and compress the images of the beam, as a phone does."""
    return recording.beams(_processed)


def curved(gamma: float) -> Callable[[Grey], Grey]:
    """Raise gray values over full scale to the power of `gamma`."""
    table = requantised(255 * np.power(np.linspace(0, 1, 256), gamma), np.zeros(0, np.uint8))
    return lambda image: np.asarray(table[image])


def frames_curved(gamma: float) -> Perturbation:
    """Change the tone curve of the frames only, like a program that edits photographs."""
    return lambda recording, _random: recording.only_frames(curved(gamma))


def all_curved(gamma: float) -> Perturbation:
    """Change the tone curve of all images."""
    return lambda recording, _random: recording.each(curved(gamma))


def flickering(share: float) -> Perturbation:
    """Brighten every image of the beam by a random factor of 1 +- `share`."""

    def perturb(recording: Recording, random: np.random.Generator) -> Recording:
        def brighten(image: Grey) -> Grey:
            return requantised(image.astype(float) * (1 + share * random.uniform(-1, 1)), image)

        return recording.beams(brighten)

    return perturb


def coloured(recording: Recording, _random: np.random.Generator) -> Recording:
    """Pass all images through a Bayer mosaic: raw, demosaiced, white-balanced, made gray."""
    return recording.each(_through_mosaic)


def left_aligned(recording: Recording, _random: np.random.Generator) -> Recording:
    """Store all images with 16 bits, the camera's 8 bits in the upper byte."""
    return recording.each(lambda image: image.astype(np.uint16) * np.uint16(256))


def one_rest_image(recording: Recording, _random: np.random.Generator) -> Recording:
    """Keep the first rest image only."""
    return replace(recording, rests=recording.rests[:1])


def copied_rest_image(recording: Recording, _random: np.random.Generator) -> Recording:
    """Replace all rest images by four copies of the first."""
    return replace(recording, rests=recording.rests[:1] * 4)


def unchanged(recording: Recording, _random: np.random.Generator) -> Recording:
    """Return the recording unchanged."""
    return recording


def _processed(image: Grey) -> Grey:
    denoised = np.asarray(cv2.fastNlMeansDenoising(image, None, _DENOISE_H)).astype(float)
    smooth = cv2.GaussianBlur(denoised, (0, 0), _SHARPEN_SIGMA_PX)
    return jpeg(requantised(denoised + _SHARPEN_AMOUNT * (denoised - smooth), image), 85)


def _through_mosaic(image: Grey) -> Grey:
    blue, green, red = _CHANNELS
    sensitivity = np.full(image.shape, green)
    sensitivity[::2, ::2], sensitivity[1::2, 1::2] = red, blue
    raw = requantised(image * sensitivity, image)
    balanced = cv2.cvtColor(raw, cv2.COLOR_BAYER_RGGB2BGR) / np.array(_CHANNELS)
    return np.asarray(cv2.cvtColor(requantised(balanced, image), cv2.COLOR_BGR2GRAY))
