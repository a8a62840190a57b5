"""What holds the beam: the motor's hub, an adaptor, and a clamp of jaw, screw, flange and cable.

Meshes are in the clamp's frame [m], except that of the hub, which is about the motor's axis. The
beam leaves the jaw at the origin, along +x. The jaw is in x <= 0: it hides nothing of the beam from
above.
"""

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import arc, box, hexagon, lofted, prism, rod, together, turned
from vbaa_bench.geometry.tube import tube

_SIDES = 60
# Chamfer of the jaw's upper half and of the flange, over their smallest side. Chosen.
_CHAMFER = 0.12
# The screw's head and its hexagonal socket, over the head's radius, as in ISO 4762.
_HEAD_HEIGHT, _SOCKET, _SOCKET_DEPTH, _BEVEL = 1.1, 0.5, 0.6, 0.12
# The jaw's halves are this part of the beam's diameter apart: the beam lies in two grooves.
_GAP = 0.6
_CABLE_POINTS, _CABLE_SIDES = 64, 24


def adaptor(offset: Floats, radius: float) -> Mesh:
    """Mesh the rod from the motor's axis at -offset (3,) to the clamp at the origin."""
    return rod(-offset, np.zeros(3), radius)


def hub(radius: float, bottom: float, top: float) -> Mesh:
    """Mesh the motor's hub: an upright cylinder about the z axis."""
    outline = arc(radius, 2 * np.pi * np.arange(64) / 64) + np.array([0.0, radius])
    return prism(outline, bottom, top)


def jaw(length: float, width: float, height: float, beam_diameter: float) -> Mesh:
    """Mesh the two halves of the jaw, one above the other, with a gap at the beam's height.

    The upper half has chamfered edges.
    """
    gap = min(_GAP * beam_diameter, height / 4) / 2
    chamfer = _CHAMFER * min(length, width, height)
    low, high = np.array([-length, -width / 2]), np.array([0.0, width / 2])
    lower = box(np.array([*low, -height / 2]), np.array([*high, -gap]))
    corners = np.array([[high[0], low[1]], high, [low[0], high[1]], low])
    inset = corners + chamfer * np.sign(np.array([*(low + high) / 2]) - corners)
    outlines = [(corners, gap), (corners, height / 2 - chamfer), (inset, height / 2)]
    rings = [np.column_stack([points, np.full(4, z)]) for points, z in outlines]
    return together([lower, lofted(np.array(rings))])


def screw(radius: float, middle: Floats) -> Mesh:
    """Mesh the head of a socket screw, upright, whose underside is about `middle` (3,)."""
    socket = hexagon(_SOCKET * radius, _SIDES)
    circle, top = np.full(_SIDES, radius), _HEAD_HEIGHT * radius
    bevel = _BEVEL * radius
    radii = np.array([circle, circle, circle - bevel, socket, socket])
    depth = _SOCKET_DEPTH * radius
    head = turned(radii, np.array([0.0, top - bevel, top, top, top - depth]))
    head.apply_translation(middle)
    return head


def flange(radius: float, thickness: float, top: float) -> Mesh:
    """Mesh a disc about the z axis, with a chamfered upper edge."""
    chamfer = _CHAMFER * min(radius, thickness)
    radii = np.array([radius, radius, radius - chamfer])[:, None] * np.ones(_SIDES)
    return turned(radii, np.array([top - thickness, top - chamfer, top]))


def cable(start: Floats, reach: float, length: float, radius: float, ground: float) -> Mesh:
    """Mesh a cable that leaves `start` (3,) along -x, sinks to the `ground` and leads away.

    It sinks about `reach` away, and ends `length` away, on the ground.
    """
    lying = ground + radius
    control = np.array(
        [
            start,
            start - [0.8 * reach, 0.0, 0.0],
            [start[0] - reach, 0.0, lying],
            [start[0] - 2.4 * reach, 0.02 * length, lying],
        ]
    )
    end = np.array([start[0] - length, 0.3 * length, lying])
    t = np.linspace(0, 1, _CABLE_POINTS)[:, None]
    bernstein = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
    sinking = sum(weight * point for weight, point in zip(bernstein, control, strict=True))
    # The lying part starts along the end of the sinking part, and then turns aside.
    ahead = control[3] + 0.3 * (length - 2.4 * reach) * _unit(control[3] - control[2])
    along = (1 - t) ** 2 * control[3] + 2 * t * (1 - t) * ahead + t**2 * end
    return tube(np.vstack([sinking, along[1:]]), radius, _CABLE_SIDES)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
