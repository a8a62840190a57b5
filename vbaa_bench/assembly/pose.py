"""A frame to be rendered: a step of a push, and its state."""

from dataclasses import dataclass

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.occlusion import hidden_stretch
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.random_streams import random_generator


@dataclass(frozen=True)
class Pose:
    """One frame to be rendered: a step of a push, and its state.

    A cover is placed for the state `covered`, if that is given.
    """

    experiment: Experiment
    spec: FrameSpec
    state: State
    covered: State | None = None

    @property
    def motor_angle(self) -> float:
        """True motor angle [rad]."""
        return self.spec.motor_angle(self.state.pushing_angle)

    @property
    def camera_frame_from_clamp(self) -> Floats:
        """Transform (4, 4) from the clamp's frame to the frame in which the camera is fixed."""
        return self.experiment.camera_frame_from_clamp(self.motor_angle)

    @property
    def hidden(self) -> tuple[float, float] | None:
        """The stretch [m] of the beam that is covered or removed."""
        scene = self.experiment.scene
        random = random_generator(scene, "cover", self.spec.index)
        length = scene.beam.length_mm * MILLIMETRE
        return hidden_stretch(self.spec.cover, self.covered or self.state, length, random)
