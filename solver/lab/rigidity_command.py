"""The command `rigidity`: EI from a hung weight."""

from dataclasses import replace
from typing import Annotated

import numpy as np
import typer
from scipy.constants import g

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.instrument.observation import rig_file
from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE
from solver.lab.controls import NO_CONTROLS
from solver.lab.options import RigOption, open_inputs
from solver.lab.shots import Shot
from solver.learning.hung_rigidity import HungWeight, flexural_rigidity
from solver.set_up import set_up
from solver.to_measurement import to_measurement
from solver.tracker import extract_centreline


def rigidity(
    images: Annotated[list[str], typer.Argument(help="images of the beam under the weight")],
    rig: RigOption,
    weight_g: Annotated[float, typer.Option(min=0, help="mass, thread included")],
    at_mm: Annotated[float, typer.Option(min=0, help="its distance from the clamp")],
    weight_sigma_g: Annotated[float, typer.Option(min=0, help="error of the mass")] = 0.01,
    at_sigma_mm: Annotated[float, typer.Option(min=0, help="error of the distance")] = 0.5,
    level_sigma_deg: Annotated[
        float, typer.Option(min=0, help="one-sigma tilt of the clamp")
    ] = 0.5,
    gravity_m_s2: Annotated[float, typer.Option(min=0, help="local gravity")] = g,
) -> None:
    """Estimate EI from a weight that hangs on the beam, in the calibration board's plane."""
    if weight_g == 0 or gravity_m_s2 == 0:
        raise InputError("--weight-g and --gravity-m-s2 must be above 0")
    observations, source, *_ = open_inputs(images, rig, None, None, NO_CONTROLS)
    if source.live:
        raise InputError("rigidity needs images: save some with the command snap")
    antenna = set_up(observations)
    # The sag at rest is a load to be fitted, not a bow to be subtracted.
    at_rest = replace(antenna.at_rest, line=antenna.at_rest.line.without_bow())
    weightless = replace(antenna.rig, sag_in_plane=np.zeros(2))
    antenna = replace(antenna, at_rest=at_rest, rig=weightless)

    def measurement_of(image: Grey) -> Measurement:
        return to_measurement(antenna, extract_centreline(antenna, image))

    def loaded(shot: Shot) -> Measurement:
        image = shot.pixels()
        try:
            return measurement_of(image)
        except InputError as error:
            raise InputError(f"{shot.name}: {error}") from error

    newton = gravity_m_s2 / 1e3
    result = flexural_rigidity(
        [measurement_of(image) for image in observations.read_rest_images()],
        [loaded(shot) for shot in source],
        HungWeight(
            force=weight_g * newton,
            force_sigma=weight_sigma_g * newton,
            at=at_mm * MILLIMETRE,
            at_sigma=at_sigma_mm * MILLIMETRE,
            level_sigma=level_sigma_deg * DEGREE,
        ),
    )
    value, sigma = result.value / NEWTON_SQUARE_MILLIMETRE, result.sigma / NEWTON_SQUARE_MILLIMETRE
    nominal = observations.rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE
    print(
        f"EI = {value:.5g} +- {sigma:.2g} N mm^2 ({100 * sigma / value:.2g} %), "
        f"{100 * (value / nominal - 1):+.2f} % from the rig's {nominal:.5g}; "
        f"+- {100 * result.known_shape_sigma / result.value:.2g} % if taper and clamp were known.\n"
        f"Fitted place of the weight: {result.at / MILLIMETRE:.2f} "
        f"+- {result.at_sigma / MILLIMETRE:.2f} mm; tip sag by own weight: "
        f"{abs(result.sag) / MILLIMETRE:.2f} mm; residual scatter: {result.misfit:.2g} sigma.\n"
        f"In {rig_file(rig)}, under beam, write\n"
        f'    "flexural_rigidity_n_mm2": {value:.6g},\n'
        f'    "flexural_rigidity_sigma_n_mm2": {sigma:.3g},\n'
        "and under beam_shape, for forces in this plane only, whose EI is now known, write\n"
        '    "rigidity_sigma": 0,'
    )
