"""Contacts of all frames of one push as functions of what they have in common.

In a push, place, direction, stiffness and friction of the object do not change, and neither does
the motor's angle at first contact. With the encoder's angles they determine place, size and
direction of the contact force in every frame.
"""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.limits.imaged_beam import SHAPE
from vbaa_bench.limits.prior import friction_sigma, uncertain_shape
from vbaa_bench.mechanics.loaded import Load
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.push import StepTarget

RIGIDITY: Final = "rigidity"
# Relative step of the differences. Measured: with a half or double step they change by less than
# 1e-3.
_STEP: Final = 1e-3


class PushGradients(NamedTuple):
    """Gradients (f, 5, p) of f frames' contacts, and friction, with respect to p `names`.

    They are the object's place along the beam [m], the inclination of its normal [rad], its
    compliance [m/N], the motor's angle at first contact [rad], the beam's rigidity [N m^2] and
    uncertain shape and, if there is friction, its coefficient. `of_angle` (f, 5) are those with
    respect to each frame's own pushing angle [rad].
    """

    names: tuple[str, ...]
    gradients: Floats
    of_angle: Floats


def push_gradients(experiment: Experiment, states: list[State]) -> PushGradients:
    """Differentiate the contacts of a push. Raises EquilibriumError.

    Every frame must have a contact.
    """
    angles = tuple(state.pushing_angle for state in states)
    targets = tuple(StepTarget(None, angle) for angle in angles)
    base = _Variant(replace(experiment, push=replace(experiment.push, targets=targets)))
    variants = {
        "contact_distance": base.experiment.rig.beam.length,
        "normal": 1.0,
        "compliance": base.softest,
        "onset": max(angles),
        RIGIDITY: base.experiment.rig.beam.flexural_rigidity,
    }
    if experiment.push.contact_distance is None:
        del variants["contact_distance"]
    if base.friction > 0 or friction_sigma(experiment.scene):
        variants["friction"] = 1.0
    uncertain = uncertain_shape(experiment.scene)
    variants |= {name: unit for name, unit in base.shape_units.items() if name in uncertain}
    columns = {name: base.gradient(name, unit) for name, unit in variants.items()}
    names = tuple(columns)
    return PushGradients(
        names, np.stack([columns[name] for name in names], axis=-1), columns["onset"]
    )


@dataclass(frozen=True)
class _Variant:
    """A push whose targets are pushing angles."""

    experiment: Experiment

    @property
    def friction(self) -> float:
        return self.experiment.scene.object.friction_coefficient()

    @property
    def softest(self) -> float:
        """Compliance [m/N] of the beam at the contact, the natural unit of the object's."""
        rod = self.experiment.rod
        lever = self.experiment.push.contact_distance or rod.beam.length
        return lever**3 / (3 * rod.beam.flexural_rigidity)

    @property
    def shape_units(self) -> dict[str, float]:
        """Natural units of the parameters of the beam's shape that change the contacts.

        A skew of the section changes them in second order only.
        """
        tip, bow, rigidity, _, softness = SHAPE
        bent = 1 / self.experiment.rig.beam.length
        return {tip: 1.0, bow: bent, rigidity: 1.0, softness: 1.0}

    def gradient(self, name: str, unit: float) -> Floats:
        """Differentiate the contacts (f, 5) by one parameter."""
        step = _STEP * unit
        least = {"compliance": self.experiment.push.compliance, "friction": self.friction}
        if least.get(name, step) < step:
            # A compliance is not negative, and neither is a coefficient of friction.
            return (self._changed(name, step)._loads() - self._loads()) / step
        ahead, behind = (self._changed(name, sign * step)._loads() for sign in (1, -1))
        return (ahead - behind) / (2 * step)

    def _loads(self) -> Floats:
        loads = [Load.of(state) for state in self.experiment.states()]
        return np.array([[a.s, a.normal_force, a.direction, *a.friction] for a in loads])

    def _changed(self, name: str, change: float) -> "_Variant":
        one, push = self.experiment, self.experiment.push
        tip, bow, section_rigidity, _, softness = SHAPE
        if name in (RIGIDITY, section_rigidity):
            rigidity = one.rig.beam.flexural_rigidity
            rigidity += change if name == RIGIDITY else change * rigidity
            beam = replace(one.rig.beam, flexural_rigidity=rigidity)
            return _Variant(replace(one, rig=replace(one.rig, beam=beam)))
        if name in (tip, bow, softness):
            spec = one.scene.beam
            sagitta = change * one.rig.beam.length**2 / 8 / MILLIMETRE
            moved = {
                tip: {"tip_ratio": spec.tip_ratio + change},
                bow: {"bow_mm": spec.bow_mm + sagitta},
                softness: {softness: spec.clamp_softness + change},
            }
            spec = spec.model_copy(update=moved[name])
            return _Variant(replace(one, scene=one.scene.model_copy(update={"beam": spec})))
        if name == "friction":
            touched = one.scene.object.model_copy(update={"friction": self.friction + change})
            return _Variant(replace(one, scene=one.scene.model_copy(update={"object": touched})))
        if name == "onset":
            targets = tuple(
                StepTarget(None, (target.pushing_angle or 0.0) + change) for target in push.targets
            )
            return _Variant(replace(one, push=replace(push, targets=targets)))
        return _Variant(replace(one, push=replace(push, **{name: getattr(push, name) + change})))
