"""Change of the beam's image with every parameter that is estimated or only roughly known.

Parameters are the contact's place, force and direction, the clamp's pose, the beam's length and
rigidity, and the camera. A measurement of the centreline shows only the change across the beam's
image; its end shows the change along it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, rigid
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.mechanics.rod import Rod

# The contact: arc length [m], force across the beam [N], direction of the force [rad].
CONTACT: Final = ("s_c", "normal_force", "direction")
# The clamp's position [m], its turn about z [rad], length [m] and flexural rigidity [N m^2].
BEAM: Final = ("clamp_x", "clamp_y", "clamp_z", "tilt", "length", "rigidity")
# The camera: intrinsics [px], rotation [rad] and translation [m] of its own axes.
INTRINSICS: Final = ("fx", "fy", "cx", "cy")
POSE: Final = ("turn_x", "turn_y", "turn_z", "move_x", "move_y", "move_z")
PARAMETERS: Final = (*CONTACT, *BEAM, *INTRINSICS, *POSE)

# Step of the central differences: relative to the parameter, or to the natural unit of those that
# are zero. Measured: a step of half or double this size changes them by less than 1e-4; with a
# tenth, rounding errors of the equilibrium are larger than that.
_STEP: Final = 1e-3


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

    def pixels(self, fractions: Floats) -> Floats:
        """Project the centreline (n, 2) [px] at increasing fractions (n,) of the length."""
        beam = loaded(self.rod, self.loads, fractions * self.rod.beam.length, self.turned)
        return self.camera.project(apply(self.frame_from_clamp, beam.centreline[:, 1:]))

    def changed(self, name: str, change: float) -> "ImagedBeam":
        """Return the same with one of PARAMETERS changed."""
        if name in CONTACT:
            first = self.loads[0]
            key = "s" if name == "s_c" else name
            load = replace(first, **{key: getattr(first, key) + change})
            return replace(self, loads=(load, *self.loads[1:]))
        if name in BEAM[:4]:
            move, turn = np.zeros(3), np.zeros(3)
            if name == "tilt":
                turn[2] = change
            else:
                move["xyz".index(name[-1])] = change
            return replace(self, frame_from_clamp=self.frame_from_clamp @ rigid(turn, move))
        if name in BEAM:
            key = "flexural_rigidity" if name == "rigidity" else name
            beam = replace(self.rod.beam, **{key: getattr(self.rod.beam, key) + change})
            return replace(self, rod=replace(self.rod, beam=beam))
        if name in INTRINSICS:
            camera = replace(self.camera, **{name: getattr(self.camera, name) + change})
            return replace(self, camera=camera)
        move, turn = np.zeros(3), np.zeros(3)
        (turn if name.startswith("turn") else move)["xyz".index(name[-1])] = change
        pose = rigid(turn, move) @ self.camera.camera_from_antenna
        return replace(self, camera=replace(self.camera, camera_from_antenna=pose))

    def unit(self, name: str) -> float:
        """Return the natural unit of a parameter: its own value, the beam's length, or 1 rad."""
        first, beam, camera = self.loads[0], self.rod.beam, self.camera
        values = {
            "s_c": first.s,
            "normal_force": first.normal_force,
            "length": beam.length,
            "rigidity": beam.flexural_rigidity,
            "fx": camera.fx,
            "fy": camera.fy,
            "cx": float(camera.width),
            "cy": float(camera.height),
        }
        if name in values:
            return values[name]
        return beam.length if name.startswith(("clamp", "move")) else 1.0


class ImageShape(NamedTuple):
    """Image of the centreline and its change with p parameters.

    `pixels` (n, 2) are places on it and `normals` (n, 2) the unit vectors across it. `steps` (n,)
    [px] are the lengths of the image that the places stand for; their sum is the image's length.
    `across` (p, n) and `tip_along` (p,) are the changes of the places across the image, and of its
    end along it, in [px] per SI unit of each parameter.
    """

    pixels: Floats
    normals: Floats
    steps: Floats
    across: Floats
    tip_along: Floats


def image_shape(imaged: ImagedBeam, parameters: Sequence[str], places: int = 200) -> ImageShape:
    """Differentiate the image of a beam at evenly spaced places. Raises EquilibriumError."""
    # The clamp, the middles of equal parts of the length, and the tip.
    fractions = np.concatenate([[0.0], (np.arange(places) + 0.5) / places, [1.0]])
    line = imaged.pixels(fractions)
    tangents = np.gradient(line, fractions, axis=0)
    lengths = np.linalg.norm(tangents, axis=1)
    tangents = tangents / lengths[:, None]
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    changes = []
    for name in parameters:
        step = _STEP * imaged.unit(name)
        ahead, behind = (imaged.changed(name, sign * step).pixels(fractions) for sign in (1, -1))
        changes.append((ahead - behind) / (2 * step))
    change = np.array(changes)
    inner = slice(1, -1)
    return ImageShape(
        pixels=line[inner],
        normals=normals[inner],
        steps=lengths[inner] / places,
        across=np.einsum("pni,ni->pn", change, normals)[:, inner],
        tip_along=change[:, -1] @ tangents[-1],
    )
