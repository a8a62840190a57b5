"""Construction of the image sensor that a scene specifies."""

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.units import MICRO, PERCENT
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.scene.lights.flicker import FlickerSpec
from vbaa_bench.sensor.fixed_pattern import FixedPattern
from vbaa_bench.sensor.ideal import Ideal
from vbaa_bench.sensor.mosaic import Mosaic
from vbaa_bench.sensor.sensor import Sensor
from vbaa_bench.sensor.shutter import STEADY, Flicker


def metered_exposure(spec: SensorSpec, peak_radiance: float) -> float:
    """Compute the exposure that puts `peak_radiance` at the beam's fraction of full scale.

    Black level, dark current and gamma are taken into account. The unit is photons per unit of
    radiance, or full scales per unit of radiance for an ideal sensor. Raises InputError if the peak
    is not positive.
    """
    if not peak_radiance > 0:
        raise InputError("no light reaches the beam and the camera: see light or lights")
    if spec.kind == "ideal":
        return spec.beam_peak_pct * PERCENT / peak_radiance
    electrons = spec.peak_signal - spec.dark_signal
    return electrons / (spec.quantum_efficiency * peak_radiance)


def metered_peak(beam: Floats, image: Floats) -> float:
    """Return the radiance by which an exposure is metered, from that of a beam and of its image.

    It is exceeded by the brightest hundredth of the beam, or by the brightest tenth of the image if
    that is brighter, such as a panel behind the beam.
    """
    return max(float(np.quantile(beam, 0.99)), float(np.quantile(image, 0.9)))


def unsaturated_exposure(spec: SensorSpec, exposure: float, peak_radiance: float) -> float:
    """Return the exposure, or the metered one for `peak_radiance` if that would be saturated.

    The units are those of `metered_exposure`.
    """
    metered = metered_exposure(spec, peak_radiance)
    if spec.kind == "ideal":
        peak_over_full_scale = spec.beam_peak_pct * PERCENT
    else:
        full_scale = spec.gain * (spec.full_scale - spec.black_level_gray)
        peak_over_full_scale = (spec.peak_signal - spec.dark_signal) / full_scale
    return metered if exposure * peak_over_full_scale > metered else exposure


def fixed_pattern(
    spec: SensorSpec, shape: tuple[int, int], random: np.random.Generator
) -> FixedPattern | None:
    """Draw the pattern (h, w) of one sensor, used for all its frames; None if it has none."""
    hot, dead = spec.hot_pixels_ppm * MICRO, spec.dead_pixels_ppm * MICRO
    if spec.prnu_pct == spec.dsnu_e == hot == dead == 0:
        return None
    pattern = FixedPattern.draw(shape, spec.prnu_pct * PERCENT, spec.dsnu_e, random)
    if hot == dead == 0:
        return pattern
    return pattern.with_defects(hot, spec.hot_dark_current_e_s * spec.exposure_s, dead, random)


def flicker(spec: FlickerSpec | None, random: np.random.Generator) -> Flicker:
    """Draw the phase of the light in one image; light without flicker is steady."""
    if spec is None:
        return STEADY
    frequency = 2 * np.pi * 2 * spec.mains_hz
    return Flicker(spec.depth_pct * PERCENT, frequency, random.uniform(0, 2 * np.pi))


def image_sensor(
    spec: SensorSpec, exposure: float, pattern: FixedPattern | None = None
) -> Sensor | Ideal:
    """Build the sensor, with the exposure of `metered_exposure`."""
    if spec.kind == "ideal":
        return Ideal(exposure, spec.bits)
    return Sensor(
        exposure=exposure,
        full_well=spec.full_well_e,
        read_noise=spec.read_noise_e,
        quantum_efficiency=spec.quantum_efficiency,
        dark_signal=spec.dark_signal,
        bits=spec.bits,
        gain=spec.gain,
        black_level=spec.black_level_gray,
        gamma=spec.gamma,
        pattern=pattern,
        mosaic=_mosaic(spec),
        jpeg_quality=spec.jpeg_quality,
    )


def _mosaic(spec: SensorSpec) -> Mosaic | None:
    """Build the mosaic of a colour sensor, its most sensitive channel with the signal 1."""
    bayer = spec.bayer
    if bayer is None:
        return None
    largest = max(bayer.red, bayer.green, bayer.blue)
    return Mosaic(
        red=bayer.red / largest,
        green=bayer.green / largest,
        blue=bayer.blue / largest,
        pattern=bayer.pattern,
        white_balance=bayer.white_balance,
        edge_aware=bayer.demosaicing == "edge_aware",
    )
