"""A loaded beam before a camera, and the same with a changed parameter.

Parameters are all that is estimated or only roughly known: the contact's place, force and
direction, the clamp's pose, the beam's length, rigidity and shape, and the camera.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, turn_about_z
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.limits.camera_parameters import INTRINSICS, POSE, camera_unit, changed_camera
from vbaa_bench.mechanics.loaded import Load, LoadedBeam, loaded
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.state import State

# The contact: arc length [m], force across the beam [N], direction of the force [rad]; friction
# along the beam and across it, relative to that force; and the same of a second contact.
CONTACT: Final = ("s_c", "normal_force", "direction")
FRICTION: Final = ("friction_along", "friction_across")
SECOND_CONTACT: Final = ("second_s_c", "second_normal_force", "second_direction")
# The clamp's position [m] and its turn about z [rad], length [m] and flexural rigidity [N m^2] of
# the beam. Then what differs from a uniform beam on a rigid clamp: tip ratio, bow [1/m], relative
# change of EI by a section out of round, skew of that section, and the clamp's rotation over its
# moment [L / EI]. A skew e turns the direction in which the beam bends by e.
CLAMP: Final = ("clamp_x", "clamp_y", "clamp_z", "motor_angle")
BEAM: Final = ("length", "rigidity")
SHAPE: Final = ("tip_ratio", "bow", "section_rigidity", "section_skew", "clamp_softness")
PARAMETERS: Final = (*CONTACT, *CLAMP, *BEAM, *INTRINSICS, *POSE)
# Shift of the image since the rest images [px].
CAMERA_SHIFT: Final = ("camera_shift_x", "camera_shift_y")
_SHIFTED: Final = dict(zip(CAMERA_SHIFT, ("cx", "cy"), strict=True))
_SECOND: Final = "second_"

# Step of the central differences: relative to the parameter, or to the natural unit of those that
# are zero. Measured: a step of half or double this size changes them by less than 1e-4; with a
# tenth, rounding errors of the equilibrium are larger than that.
STEP: Final = 1e-3
# Places on the beam's image. Measured: with twice as many, information changes by less than 0.1 %.
PLACES: Final = 200
# Of the length: the clamp, the middles of equal parts, and the tip.
FRACTIONS: Final = np.concatenate([[0.0], (np.arange(PLACES) + 0.5) / PLACES, [1.0]])


@dataclass(frozen=True)
class ImagedBeam:
    """A loaded beam before a camera: the state whose image is differentiated.

    The first of `loads` is the contact that is estimated. `frame_from_clamp` (4, 4) maps the
    clamp's frame to the camera's fixed frame, and `turned` (3, 3) the world to the clamp's.
    """

    rod: Rod
    loads: tuple[Load, ...]
    camera: Camera
    frame_from_clamp: Floats
    turned: Floats | None = None
    # The beam's shape, if it has been computed.
    shape: LoadedBeam | None = field(default=None, repr=False)

    @classmethod
    def of(cls, pose: Pose, camera: Camera) -> "ImagedBeam":
        """Return the beam of a frame under the loads of its contacts."""
        return cls._in_state(pose.experiment, pose.state, pose.motor_angle, camera)

    @classmethod
    def at_rest(cls, experiment: Experiment, camera: Camera) -> "ImagedBeam":
        """Return the beam before contact, with the motor at angle zero."""
        return cls._in_state(experiment, experiment.rest, 0.0, camera)

    @classmethod
    def _in_state(
        cls, experiment: Experiment, state: State, motor_angle: float, camera: Camera
    ) -> "ImagedBeam":
        frame_from_clamp = experiment.camera_frame_from_clamp(motor_angle).copy()
        frame_from_clamp[:3, 3] += experiment.rig.base_position
        return cls(
            rod=experiment.rod,
            loads=tuple(Load.of(state, i) for i in range(len(state.contacts))),
            camera=camera,
            frame_from_clamp=frame_from_clamp,
            turned=experiment.clamp_from_world(-state.pushing_angle)[:3, :3],
        )

    @cached_property
    def beam(self) -> LoadedBeam:
        """The beam at FRACTIONS of its length. Raises EquilibriumError."""
        lengths = FRACTIONS * self.rod.beam.length
        return self.shape or loaded(self.rod, self.loads, lengths, self.turned)

    @property
    def pixels(self) -> Floats:
        """Image of the centreline (n, 2) [px] at FRACTIONS of its length."""
        points = self.beam.centreline[:, 1:]
        return self.camera.project(apply(self.frame_from_clamp, points))

    @property
    def pixels_per_metre(self) -> Floats:
        """Magnification (n,) [px/m] of the beam at FRACTIONS of its length."""
        points = apply(self.frame_from_clamp, self.beam.centreline[:, 1:])
        return self.camera.pixels_per_metre(points)

    def neighbours(self, names: Sequence[str]) -> "dict[str, Neighbours]":
        """Return the beams with each parameter decreased and increased by a small step."""
        steps = {name: STEP * self.unit(name) for name in names}
        return {
            name: Neighbours(self.changed(name, -step), self.changed(name, step), 2 * step)
            for name, step in steps.items()
        }

    def changed(self, name: str, change: float) -> "ImagedBeam":
        """Return the same with one of PARAMETERS changed."""
        if name in (*CONTACT, *FRICTION, *SECOND_CONTACT):
            return self._with_load(name.removeprefix(_SECOND), change, name.startswith(_SECOND))
        if name in (*BEAM, *SHAPE):
            return replace(self, rod=_changed_rod(self.rod, name, change), shape=None)
        if name == "motor_angle":
            turned = self.frame_from_clamp @ turn_about_z(change)
            return replace(self, frame_from_clamp=turned, shape=self.beam)
        if name in CLAMP:
            moved = self.frame_from_clamp.copy()
            moved["xyz".index(name[-1]), 3] += change
            return replace(self, frame_from_clamp=moved, shape=self.beam)
        camera = changed_camera(self.camera, _SHIFTED.get(name, name), change)
        return replace(self, camera=camera, shape=self.beam)

    def unit(self, name: str) -> float:
        """Return the natural unit of a parameter: its own value, the beam's length, or 1."""
        beam, key = self.rod.beam, name.removeprefix(_SECOND)
        if key in ("s_c", "normal_force"):
            load = self.loads[int(name.startswith(_SECOND))]
            return load.s if key == "s_c" else load.normal_force
        values = {
            "length": beam.length,
            "rigidity": beam.flexural_rigidity,
            "bow": 1 / beam.length,
        }
        if name in values:
            return values[name]
        if name.startswith(("clamp", "move")):
            return beam.length
        return camera_unit(self.camera, _SHIFTED.get(name, name))

    def _with_load(self, name: str, change: float, second: bool) -> "ImagedBeam":
        """Change a parameter of the first or of the second load."""
        loads, number = list(self.loads), int(second)
        load = loads[number]
        along, across = load.friction
        if name in FRICTION:
            moved = (along + change, across) if name == FRICTION[0] else (along, across + change)
            loads[number] = replace(load, friction=moved)
        else:
            key = "s" if name == "s_c" else name
            loads[number] = replace(load, **{key: getattr(load, key) + change})
        return replace(self, loads=tuple(loads), shape=None)


def _changed_rod(rod: Rod, name: str, change: float) -> Rod:
    if name in ("tip_ratio", "clamp_softness"):
        return replace(rod, **{name: getattr(rod, name) + change})
    if name == "bow":
        return replace(rod, bow=(rod.bow[0] + change, rod.bow[1]))
    if name == "section_skew":
        return _skewed(rod, change)
    if name == "section_rigidity":
        name, change = "rigidity", change * rod.beam.flexural_rigidity
    key = "flexural_rigidity" if name == "rigidity" else name
    beam = replace(rod.beam, **{key: getattr(rod.beam, key) + change})
    return replace(rod, beam=beam)


def _skewed(rod: Rod, skew: float) -> Rod:
    """Return a rod whose force towards y also bends it towards z, as stiff as before towards y.

    A section with axes in the ratio 1 + e, the first inclined by a from y, is the vector
    e (cos 2a, sin 2a), to first order; a skew is added to its second component.
    """
    excess, angle = rod.aspect_ratio - 1, 2 * rod.section_angle
    plain, skewed = excess * np.cos(angle), excess * np.sin(angle) + skew
    size = float(np.hypot(plain, skewed))
    rigidity = rod.beam.flexural_rigidity * (1 + excess - plain) / (1 + size - plain)
    return replace(
        rod,
        beam=replace(rod.beam, flexural_rigidity=rigidity),
        aspect_ratio=1 + size,
        section_angle=float(np.arctan2(skewed, plain)) / 2,
    )


class Neighbours(NamedTuple):
    """A loaded beam with one parameter decreased and increased, and the difference."""

    behind: ImagedBeam
    ahead: ImagedBeam
    difference: float
