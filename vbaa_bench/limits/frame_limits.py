"""Information limits of one frame: least standard deviations, for each information set."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.assembly.scene_assembler import Pose
from vbaa_bench.limits.image_shape import (
    BEAM,
    CLAMP,
    CONTACT,
    FRICTION,
    SECOND_CONTACT,
    SHAPE,
    ImagedBeam,
    Neighbours,
)
from vbaa_bench.limits.named_information import Information
from vbaa_bench.limits.of_frame import imaged_beam
from vbaa_bench.limits.quantities import QUANTITIES, Gradients, gradients
from vbaa_bench.limits.rig_information import RigInformation
from vbaa_bench.scene.rigs import nominal_rig

# Ratio of friction to normal force that counts as friction. Chosen: above rounding errors.
_FRICTION = 1e-6


@dataclass(frozen=True)
class FrameLimits:
    """Limits of a frame with a contact: of its pose, with the rig's data before any contact.

    `visible` (n,) is the visible fraction of n equal parts of the beam's length.
    """

    rig: RigInformation
    pose: Pose
    visible: Floats

    def by_set(self) -> Iterator[tuple[str, Floats]]:
        """Yield each information set, and the limits (4,) of `quantities.QUANTITIES` in it.

        Infinite ones cannot be determined from these data; psi is NaN where it is known. Raises
        EquilibriumError.
        """
        planar = self._limits(self.image.without({CONTACT[2]}))
        yield "planar", np.where(np.array(QUANTITIES) == "psi", np.nan, planar)
        yield "image", self._limits(self.image)
        sensors = nominal_rig(self.rig.scene).sensors
        _, readings = self.gradients
        if sensors.moment_y is not None:
            yield "moment", self._limits(self.image + self._read([4], [sensors.moment_y]))
        if sensors.base_force is not None and sensors.base_moment is not None:
            sigmas = [sensors.base_force] * 3 + [sensors.base_moment] * 3
            yield "force", self._limits(self.image + self._read(list(range(len(readings))), sigmas))

    @cached_property
    def image(self) -> Information:
        """Information of the image and of all data before it."""
        return (self.of_image + self.rig.before_contact).without(self.rig.known)

    @cached_property
    def of_image(self) -> Information:
        """Information of the image alone."""
        image = self.rig.of_image(
            self.imaged, self.pose.state, self._neighbours, self.visible, self.pose.spec.scene
        )
        # The light may have changed since the rest images.
        return image.eliminated({"brightness", "background"})

    @cached_property
    def gradients(self) -> Gradients:
        """Gradients of quantities and readings with respect to `self.bending`."""
        bending = {name: self._neighbours[name] for name in self.bending}
        return gradients(bending, self.contact_at_rest)

    @property
    def contact_at_rest(self) -> Floats:
        """Place (3,) [m] of the contact on the beam before contact."""
        line, s = self.pose.experiment.rest.centreline, self.pose.state.contact.s
        return np.array([np.interp(s, line[:, 0], column) for column in line[:, 1:].T])

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters of this frame alone."""
        names: tuple[str, ...] = CONTACT
        load = self.imaged.loads[0]
        for name, ratio in zip(FRICTION, load.friction, strict=True):
            names += (name,) if abs(ratio) > _FRICTION else ()
        if len(self.imaged.loads) > 1:
            names += SECOND_CONTACT
        if self.rig.scene.camera.mount == "world":
            names += (CLAMP[3],)  # no encoder reads it
        return names

    @property
    def bending(self) -> tuple[str, ...]:
        """Parameters on which the beam's shape depends."""
        shape = {*CONTACT, *FRICTION, *SECOND_CONTACT, *BEAM, *SHAPE}
        return tuple(name for name in self._neighbours if name in shape)

    @cached_property
    def _neighbours(self) -> dict[str, Neighbours]:
        names = (*self.parameters, *self.rig.parameters(self.imaged.camera))
        return self.imaged.neighbours(names)

    @cached_property
    def imaged(self) -> ImagedBeam:
        """The loaded beam before the camera of the frames."""
        return imaged_beam(self.pose, self.rig.rig.knocked(self.rig.scene).camera)

    def _read(self, rows: list[int], sigmas: list[float]) -> Information:
        """Return the information of readings of the sensors at the clamp."""
        return Information.of_readings(
            self.bending, self.gradients.readings[rows], np.array(sigmas)
        )

    def _limits(self, information: Information) -> Floats:
        rows = [dict(zip(self.bending, row, strict=True)) for row in self.gradients.quantities]
        return information.sigmas(information.gradients(rows), self.rig.errorless)
