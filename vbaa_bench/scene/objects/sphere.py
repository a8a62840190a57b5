"""A sphere."""

from typing import Final, Literal

import numpy as np
from pydantic import Field

from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh, mesh_of
from vbaa_bench.geometry.solids import side_count
from vbaa_bench.geometry.tube import tube_faces
from vbaa_bench.mechanics.surfaces import Ball, ball
from vbaa_bench.scene.objects.object import ObjectSetting, TouchedKind
from vbaa_bench.scene.part import Positive

# A sphere is meshed finely up to this polar angle [rad] from where it is touched.
NEAR: Final = 0.5


class SphereSpec(TouchedKind):
    """A sphere, touched at its equator; the beam slips off one that is too small."""

    kind: Literal["sphere"]
    radius_mm: Positive = Field(default=40, description="Radius of the sphere.")

    def surface(self, _setting: ObjectSetting) -> Ball:
        """Return the sphere."""
        return ball(self.radius_mm * MILLIMETRE)

    def mesh(self, _setting: ObjectSetting, _give: float = 0.0, _slope: float = 0.0) -> Mesh:
        """Build the sphere."""
        return sphere(self.radius_mm * MILLIMETRE)


def sphere(radius: float) -> Mesh:
    """Mesh a sphere with a pole, a vertex, at the origin, finely about that pole."""
    # The rings of latitude shrink towards the pole, and so does the sagitta of their chords.
    around = side_count(radius * np.sin(NEAR) ** 2)
    fine = int(np.ceil(NEAR * side_count(radius) / (2 * np.pi)))
    polar = np.concatenate(
        [np.linspace(np.pi, NEAR, 64, endpoint=False), np.linspace(NEAR, 0, fine, endpoint=False)]
    )[1:, None]
    turn = 2 * np.pi * np.arange(around) / around
    rings = radius * np.stack(
        [
            np.sin(polar) * np.sin(turn),
            np.broadcast_to(np.cos(polar) - 1, (len(polar), around)),
            np.sin(polar) * np.cos(turn),
        ],
        axis=-1,
    )
    poles = np.array([[0.0, -2 * radius, 0.0], [0.0, 0.0, 0.0]])
    vertices = np.vstack([rings.reshape(-1, 3), poles])
    return mesh_of(vertices, tube_faces(len(polar), around))
