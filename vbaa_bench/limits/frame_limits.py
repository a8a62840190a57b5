"""Information limits of one frame: least standard deviations, for each information set."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.limits.imaged_beam import (
    BEAM,
    CAMERA_SHIFT,
    CLAMP,
    CONTACT,
    FRICTION,
    SECOND_CONTACT,
    SHAPE,
    ImagedBeam,
    Neighbours,
)
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.prior import friction_sigma
from vbaa_bench.limits.quantities import QUANTITIES, SECOND, Gradients, gradients
from vbaa_bench.limits.rig_information import RigInformation
from vbaa_bench.scene.rigs import nominal_rig

# Ratio of friction to normal force that counts as friction. Chosen: above rounding errors.
_FRICTION = 1e-6


@dataclass(frozen=True)
class FrameLimits:
    """Limits of a frame with a contact: of its pose, with the rig's data before any contact.

    `visible` (n,) is the visible fraction of n equal parts of the beam's length. `learned` is the
    information of other pushes on the rig, from which the beam is learned; None if there are none.
    """

    rig: RigInformation
    pose: Pose
    visible: Floats
    learned: Information | None = None

    def by_set(self) -> Iterator[tuple[str, Floats]]:
        """Yield each information set, and the limits (6,) of `quantities.QUANTITIES` in it.

        Infinite ones cannot be determined from these data; psi is NaN where it is known, and so are
        those of a second contact that does not exist. Raises EquilibriumError.
        """
        in_plane = self.image.without({CONTACT[2], SECOND_CONTACT[2]})
        yield "planar", self._limits(in_plane, {"psi"})
        if self.learned is not None:
            yield "learned", self._limits(in_plane + self.learned, {"psi"})
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
        """Information of the image, of all data before it, and of what is stated of a frame."""
        all_data = self.of_image + self.rig.before_contact + self.stated
        return all_data.without(self.rig.known)

    @property
    def stated(self) -> Information:
        """Information of the stated friction of an unknown object and shift of the camera."""
        sigmas = dict.fromkeys(FRICTION, friction_sigma(self.rig.scene))
        sigmas |= dict.fromkeys(CAMERA_SHIFT, self.rig.scene.tolerances.camera_shift_px)
        return Information.of_priors({name: sigmas.get(name, 0.0) for name in self.parameters})

    @property
    def on_rig(self) -> Information:
        """Information of this image on the rig, where contact and force are in plane C."""
        in_plane = {CONTACT[2], SECOND_CONTACT[2]}
        image = (self.of_image + self.stated).without(in_plane | self.rig.known)
        return image.eliminated(self.parameters)

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
        (point,) = self.pose.experiment.rest.points_at(np.array([self.pose.state.contact.s]))
        return np.asarray(point)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters of this frame alone."""
        along, across = self.rubbing
        names: tuple[str, ...] = CONTACT
        names += FRICTION[:1] if along or friction_sigma(self.rig.scene) else ()
        names += FRICTION[1:] if across else ()
        if len(self.imaged.loads) > 1:
            names += SECOND_CONTACT
        if self.rig.scene.camera.mount == "world":
            names += (CLAMP[3],)  # no encoder reads it
        if self.rig.scene.tolerances.camera_shift_px:
            names += CAMERA_SHIFT
        return names

    @property
    def rubbing(self) -> tuple[bool, bool]:
        """Whether there is friction along the beam and across it.

        A force normal to the surface of a cone is inclined against the axis by the surface's slope.
        """
        along, across = self.imaged.loads[0].friction
        rod = self.imaged.rod
        slope = rod.beam.radius * abs(rod.tip_ratio - 1) / rod.beam.length
        return abs(along) > _FRICTION + 2 * slope, abs(across) > _FRICTION

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
        return ImagedBeam.of(self.pose, self.rig.rig.knocked(self.rig.scene).camera)

    def _read(self, rows: list[int], sigmas: list[float]) -> Information:
        """Return the information of readings of the sensors at the clamp."""
        return Information.of_readings(
            self.bending, self.gradients.readings[rows], np.array(sigmas)
        )

    @property
    def absent(self) -> frozenset[str]:
        """Quantities that do not exist in this frame."""
        return frozenset() if len(self.imaged.loads) > 1 else frozenset(SECOND)

    def _limits(self, information: Information, known: Collection[str] = ()) -> Floats:
        rows = [dict(zip(self.bending, row, strict=True)) for row in self.gradients.quantities]
        limits = information.sigmas(information.gradients(rows), self.rig.errorless)
        missing = [name in known or name in self.absent for name in QUANTITIES]
        return np.where(missing, np.nan, limits)
