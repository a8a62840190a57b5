"""A soft pad."""

from typing import ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import SAGITTA, slab
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.objects.object import ObjectSetting, Touchable, UprightKind
from vbaa_bench.scene.part import NonNegative, Positive

# A dent follows the beam from its bottom up to this angle [rad]; then its walls are straight.
HUG: Final = 80 * DEGREE
HUG_STEP: Final = 5 * DEGREE


class PadSpec(UprightKind):
    """A soft pad, rounded towards the beam, which sinks into its face."""

    deforms: ClassVar[bool] = True

    kind: Literal["pad"]
    top_mm: NonNegative = Field(default=0.3, description="Height of the top above plane C.")
    width_mm: Positive = Field(default=30, description="Width of the pad along the beam.")
    thickness_mm: Positive = Field(default=15, description="Thickness behind the face's middle.")
    face_radius_mm: Positive = Field(default=40, description="Radius of the rounded face.")

    def surface(self, _setting: ObjectSetting) -> Line:
        """Return the side of a cylinder."""
        return upright(self.face_radius_mm * MILLIMETRE)

    def touchable(self, setting: ObjectSetting) -> Touchable:
        """Return the face of the pad."""
        low, high = self.heights(setting)
        return Touchable(low, high, half_width=self.width_mm * MILLIMETRE / 2)

    def mesh(self, setting: ObjectSetting, give: float = 0.0, slope: float = 0.0) -> Mesh:
        """Build the pad, dented by `give`. Raises InputError if it is too thin for that."""
        mm = MILLIMETRE
        sizes = self.width_mm * mm, self.thickness_mm * mm, self.face_radius_mm * mm
        return pad(*sizes, *self.heights(setting), give, setting.beam_radius, slope)


def pad(
    width: float,
    thickness: float,
    face_radius: float,
    bottom: float,
    top: float,
    dent_depth: float,
    beam_radius: float,
    slope: float = 0.0,
) -> Mesh:
    """Mesh a soft pad with a convex upright face that the beam has indented by `dent_depth`.

    The origin is the bottom of the dent; without it the face would be at y = dent_depth. The
    pad's back is flat, `thickness` behind that. The beam is in z = 0 with the given slope against
    x, on the face lowered by the dent; under the beam the face runs below it. Raises InputError
    if the pad is too thin for the curvature of its face or for the dent.
    """
    if not (width <= 2 * face_radius and _drop(width / 2, face_radius) < thickness):
        raise InputError(
            f"a pad {width / MILLIMETRE:g} mm wide and {thickness / MILLIMETRE:g} mm thick cannot"
            f" have a face of radius {face_radius / MILLIMETRE:g} mm, allowed is a flatter one"
        )
    if not 0 <= dent_depth < thickness:
        raise InputError(
            f"the pad is dented by {dent_depth / MILLIMETRE:g} mm, allowed is"
            f" 0 to less than its thickness, {thickness / MILLIMETRE:g} mm"
        )
    step = min(0.25 * MILLIMETRE, np.sqrt(8 * face_radius * SAGITTA))
    half_columns = int(np.ceil(width / 2 / step))
    across = width / 2 * np.arange(-half_columns, half_columns + 1) / half_columns
    x, z = np.meshgrid(across, _pad_rows(bottom, top, beam_radius), indexing="ij")
    undented = dent_depth - _drop(x, face_radius)
    # The line of that slope tangent to the lowered face.
    below = slope * x + face_radius * (np.hypot(1.0, slope) - 1)
    front = np.stack(
        [x, below + _indented(undented - below, z, dent_depth, beam_radius), z], axis=-1
    )
    back = np.stack([x, np.full_like(x, dent_depth - thickness), z], axis=-1)
    return slab(front, back)


def _drop(x: Floats | float, radius: float) -> Floats:
    """Compute the drop [m] of a circle at the distance x [m] from its top."""
    return np.asarray(radius - np.sqrt((radius - x) * (radius + x)))


def _pad_rows(bottom: float, top: float, beam_radius: float) -> Floats:
    """Return heights z (n,) [m] of a pad's vertices: at all corners of a dent, and close beside."""
    corners = beam_radius * np.sin(np.arange(HUG_STEP / 2, HUG, HUG_STEP)) / np.cos(HUG_STEP / 2)
    shoulder = beam_radius * np.concatenate([np.linspace(1, 2, 13), np.linspace(2.25, 4, 8)])
    beside = np.concatenate([corners, shoulder])
    rows = np.concatenate([-beside[::-1], [0.0], beside])
    return np.concatenate([[bottom], rows[(rows > bottom) & (rows < top)], [top]])


def _indented(undented: Floats, z: Floats, dent_depth: float, beam_radius: float) -> Floats:
    """Indent a face at y = `undented` [m] by a beam along y = its radius, z = 0."""
    if dent_depth == 0:
        return undented
    # These are the beam's tangents: a mesh with rows at their corners cannot cut the beam, but
    # one with its vertices on the circle would.
    angle = np.arange(0, HUG + HUG_STEP / 2, HUG_STEP)
    tangents = beam_radius + (np.abs(z)[..., None] * np.sin(angle) - beam_radius) / np.cos(angle)
    carved = tangents.max(axis=-1)
    # Take the lower of the two, with the crease between them rounded off from below.
    blend = dent_depth / 2
    nearness = np.clip(blend - np.abs(undented - carved), 0, None)
    return np.asarray(np.minimum(undented, carved) - nearness**2 / (4 * blend))
