"""Construction of the image sensor that a scene specifies."""

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.units import PERCENT
from vbaa_bench.scene.image_sensor import SensorSpec
from vbaa_bench.sensor.fixed_pattern import FixedPattern
from vbaa_bench.sensor.ideal import Ideal
from vbaa_bench.sensor.sensor import Sensor


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


def fixed_pattern(
    spec: SensorSpec, shape: tuple[int, int], random: np.random.Generator
) -> FixedPattern | None:
    """Draw the pattern (h, w) of one sensor, used for all its frames; None if it has none."""
    if spec.prnu_pct == spec.dsnu_e == 0:
        return None
    return FixedPattern.draw(shape, spec.prnu_pct * PERCENT, spec.dsnu_e, random)


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
    )
