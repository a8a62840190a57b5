"""What a scene states about its beam beyond the datasheet: prior information on its shape.

A tolerance of the scene is the sigma of a quantity about that of a uniform, round beam on a rigid
clamp. A beam that differs from it, although the scene states no tolerance, is unknown; one that
does not differ is not suspected of it.
"""

from solver.instrument.beam_shape import SKEW
from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.limits.image_shape import SHAPE
from vbaa_bench.limits.named_information import Information
from vbaa_bench.scene.rigs import nominal_rig
from vbaa_bench.scene.schema import Scene


def uncertain_shape(scene: Scene) -> tuple[str, ...]:
    """List the parameters of SHAPE that are uncertain in a scene."""
    tip, bow, *_, softness = SHAPE
    beam = scene.beam
    differs = {tip: beam.tip_ratio != 1, bow: beam.bow_mm != 0, softness: beam.clamp_softness != 0}
    sigmas = _sigmas(scene)
    return tuple(name for name in SHAPE if sigmas.get(name) or differs.get(name))


def stated_shape_information(scene: Scene) -> Information:
    """Return the information of the stated tolerances on the parameters of SHAPE."""
    return Information.of_priors({name: sigma for name, sigma in _sigmas(scene).items() if sigma})


def friction_sigma(scene: Scene) -> float:
    """Return the sigma of the stated friction ratio; 0 if none is stated.

    Where the rig states that its objects are rigid, the direction of friction is known.
    """
    shape = nominal_rig(scene).shape
    return shape.friction.sigma if shape.rigid_objects else shape.friction_sigma


def _sigmas(scene: Scene) -> dict[str, float]:
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
