"""Information limits of a frame with the images of its push up to its own."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.limits.frame_limits import FrameLimits
from vbaa_bench.limits.imaged_beam import CAMERA_SHIFT, CONTACT, FRICTION
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.prior import friction_sigma
from vbaa_bench.limits.push_model import PushGradients, push_gradients
from vbaa_bench.limits.quantities import QUANTITIES
from vbaa_bench.scene.rigs import nominal_rig

_LOAD = (*CONTACT, *FRICTION)


@dataclass(frozen=True)
class PushLimits:
    """Limits of the frames of one push, all with a contact, in the order of its steps."""

    frames: Sequence[FrameLimits]

    def limits(self) -> Iterator[Floats]:
        """Yield for each frame the limits of QUANTITIES, then of the compliance [m/N], (7,).

        Infinite ones cannot be determined from these data; those of a second contact that does not
        exist are NaN. Raises EquilibriumError.
        """
        if not self.frames:
            return
        rig = self.frames[0].rig
        total = rig.before_contact.without(rig.known)
        total += Information.of_priors({"friction": friction_sigma(rig.scene)})
        for number in range(len(self.frames)):
            total += self._of_frame(number)
            rows = total.gradients([*self._quantities(number), {"compliance": 1.0}])
            absent = [name in self.frames[number].absent for name in (*QUANTITIES, "compliance")]
            yield np.where(absent, np.nan, total.sigmas(rows, rig.errorless))

    def _of_frame(self, number: int) -> Information:
        """Return one frame's information on the push, its own angle and the rig."""
        frame, names = self.frames[number], (*self._of_push.names, _angle(number))
        rows = self._rows(number)
        changes = {name: rows[i] for i, name in enumerate(_LOAD) if name in frame.parameters}
        information = frame.of_image.mapped(names, changes)
        information += frame.stated.without(FRICTION)
        # The image of a camera that is fixed in the world informs on the motor's angle, too; every
        # image is shifted in its own way.
        own = {name: f"{name}_{number}" for name in CAMERA_SHIFT}
        information = information.renamed({"motor_angle": _angle(number), **own})
        encoder = nominal_rig(frame.rig.scene).tolerances.encoder
        if frame.rig.scene.camera.mount == "world":
            return information
        if encoder == 0:
            return information.without({_angle(number)})
        return information + Information.of_priors({_angle(number): encoder})

    def _quantities(self, number: int) -> Iterator[dict[str, float]]:
        """Yield the gradient of each quantity of a frame, by parameter."""
        frame, names = self.frames[number], (*self._of_push.names, _angle(number))
        rows = self._rows(number)
        for gradient in frame.gradients.quantities:
            total: dict[str, float] = {}
            for name, value in zip(frame.bending, gradient, strict=True):
                if name not in _LOAD:
                    total[name] = total.get(name, 0.0) + float(value)
                    continue
                for column, of_push in zip(names, rows[_LOAD.index(name)], strict=True):
                    total[column] = total.get(column, 0.0) + float(value * of_push)
            yield total

    def _rows(self, number: int) -> Floats:
        """Return the gradients (5, p + 1) of a frame's contact, the last by its own motor angle."""
        # The pushing angle is the motor's angle at first contact minus that of the frame.
        of_angle = -self._of_push.of_angle[number]
        return np.column_stack([self._of_push.gradients[number], of_angle])

    @cached_property
    def _of_push(self) -> PushGradients:
        first = self.frames[0].pose
        return push_gradients(first.experiment, [frame.pose.state for frame in self.frames])


def _angle(number: int) -> str:
    """Name the motor's angle of a frame."""
    return f"motor_angle_{number}"
