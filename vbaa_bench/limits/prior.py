"""What a scene states about its rig before any image: prior information.

A tolerance of the scene is the sigma of a quantity about that of the datasheet, and about that of a
uniform, round beam on a rigid clamp. A beam that differs from such a beam, although the scene
states no tolerance, is unknown; one that does not differ is not suspected of it.
"""

import math

from solver.instrument.beam_shape import SKEW
from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.limits.board_information import BOARD
from vbaa_bench.limits.imaged_beam import BEAM, CLAMP, SHAPE
from vbaa_bench.limits.information import Information
from vbaa_bench.scene.rigs import nominal_rig
from vbaa_bench.scene.schema import Scene


def uncertain_parameters(scene: Scene) -> tuple[str, ...]:
    """List the parameters of clamp and beam that are uncertain in a scene."""
    of_rig = (name for name in rig_prior(scene).names if name not in BOARD)
    return (*of_rig, *uncertain_shape(scene))


def uncertain_shape(scene: Scene) -> tuple[str, ...]:
    """List the parameters of SHAPE that are uncertain in a scene."""
    tip, bow, *_, softness = SHAPE
    beam = scene.beam
    differs = {tip: beam.tip_ratio != 1, bow: beam.bow_mm != 0, softness: beam.clamp_softness != 0}
    sigmas = _shape_sigmas(scene)
    return tuple(name for name in SHAPE if sigmas.get(name) or differs.get(name))


def rig_prior(scene: Scene) -> Information:
    """Return the information of the stated tolerances on clamp, beam and board."""
    stated = nominal_rig(scene).tolerances
    sigmas = dict.fromkeys(CLAMP[:3], stated.base_position)
    sigmas[CLAMP[0]] = math.hypot(stated.base_position, scene.tolerances.grip_mm * MILLIMETRE)
    sigmas |= dict(zip(BEAM, (stated.beam_length, stated.flexural_rigidity), strict=True))
    sigmas |= dict.fromkeys(BOARD[:3], stated.board_rotation)
    sigmas |= dict.fromkeys(BOARD[3:], stated.board_translation)
    return Information.of_priors(sigmas)


def shape_prior(scene: Scene) -> Information:
    """Return the information of the stated tolerances on the parameters of SHAPE."""
    return Information.of_priors(_shape_sigmas(scene))


def friction_sigma(scene: Scene) -> float:
    """Return the sigma of the stated friction ratio; 0 if none is stated.

    Where the rig states that its objects are rigid, the direction of friction is known.
    """
    shape = nominal_rig(scene).shape
    return shape.friction.sigma if shape.rigid_objects else shape.friction_sigma


def _shape_sigmas(scene: Scene) -> dict[str, float]:
    stated, tolerances = nominal_rig(scene).shape, scene.tolerances
    tip, bow, rigidity, skew, softness = SHAPE
    return {
        # The curvature [1/m] that deflects the tip by as much.
        bow: 2 * (tolerances.bow_mm or 0.0) * MILLIMETRE / (scene.beam.length_mm * MILLIMETRE) ** 2,
        tip: tolerances.tip_ratio_pct * PERCENT,
        rigidity: stated.rigidity_sigma,
        skew: stated.sigma(SKEW),
        softness: tolerances.clamp_softness,
    }
