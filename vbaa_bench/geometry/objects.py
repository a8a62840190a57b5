"""Meshes around the beam: the objects it touches, the hub that holds it, the background.

Objects are in their own frame: the contact is at the origin, +y is the outward normal there,
towards the beam, and +z is the direction of the edge; x runs along the beam. The solid is in
y <= 0. At first contact the beam's centreline is the line y = its radius, z = 0. The topology
depends on an object's sizes, never on how far the beam has pushed into it. All lengths are [m].
"""

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.solids import SAGITTA, arc, box, lofted, prism, rod, sides, slab, together
from vbaa_bench.geometry.tube import tube, tube_faces

# A sphere is meshed finely up to this polar angle [rad] from where it is touched.
NEAR = 0.5

# Turns of a plunger's spring.
TURNS = 6

# A dent follows the beam from its bottom up to this angle [rad]; then its walls are straight.
HUG, HUG_STEP = 80 * DEGREE, 5 * DEGREE


def block(side: float, bottom: float, top: float, chamfer: float = 0.0) -> trimesh.Trimesh:
    """Mesh a square block with an upright edge at the origin; its diagonal is along -y.

    The edges of its top have a chamfer of 45 degrees; the upright edge ends below it.
    """
    half = side / np.sqrt(2)
    outline = np.array([[0.0, 0.0], [-half, -half], [0.0, -2 * half], [half, -half]])
    if chamfer:
        middle = outline.mean(axis=0)
        inset = middle + (1 - 2 * chamfer / side) * (outline - middle)
        levels = [(outline, bottom), (outline, top - chamfer), (inset, top)]
        rings = [np.column_stack([points, np.full(4, z)]) for points, z in levels]
        return lofted(np.array(rings))
    return prism(outline, bottom, top)


def cylinder(radius: float, bottom: float, top: float, sections: int = 128) -> trimesh.Trimesh:
    """Mesh an upright cylinder about y = -radius, with at least `sections` sides.

    A line of vertices passes through the origin.
    """
    n = sides(radius, sections)
    return prism(arc(radius, 2 * np.pi * np.arange(n) / n), bottom, top)


def sphere(radius: float) -> trimesh.Trimesh:
    """Mesh a sphere with a pole, a vertex, at the origin, finely about that pole."""
    # The rings of latitude shrink towards the pole, and so does the sagitta of their chords.
    around = sides(radius * np.sin(NEAR) ** 2)
    fine = int(np.ceil(NEAR * sides(radius) / (2 * np.pi)))
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
    return trimesh.Trimesh(vertices, tube_faces(len(polar), around), process=False)


def knife_edge(length: float, depth: float, half_angle: float) -> trimesh.Trimesh:
    """Mesh a wedge whose apex runs along z, `length` about the origin; it opens towards -y.

    Its flanks are at `half_angle` [rad] to either side of -y and reach down to y = -depth.
    """
    half = depth * np.tan(half_angle)
    outline = np.array([[0.0, 0.0], [-half, -depth], [half, -depth]])
    return prism(outline, -length / 2, length / 2)


def wall(width: float, thickness: float, bottom: float, top: float) -> trimesh.Trimesh:
    """Mesh a flat slab whose face is in y = 0 and is centred in x."""
    half = width / 2
    return box(np.array([-half, -thickness, bottom]), np.array([half, 0.0, top]))


def plunger(
    nose_radius: float, compression: float, free_length: float, bottom: float, top: float
) -> trimesh.Trimesh:
    """Mesh a sprung nose: half an upright cylinder on a stem, with a coil spring and a housing.

    The coil is between nose and housing. The nose stays at the origin; `compression` moves the
    housing nearer, whose front is at y = -nose_radius - (free_length - compression). The mesh
    has four closed bodies, one of which, the stem, reaches into two others. Raises InputError if
    the coil's turns would touch.
    """
    girth = min(nose_radius, (top - bottom) / 2)
    wire = min(0.12 * girth, free_length / (8 * TURNS))
    shortest = 2 * wire * TURNS
    if not 0 <= compression <= free_length - shortest:
        raise InputError(
            f"the plunger is pressed in by {compression / MILLIMETRE:g} mm,"
            f" allowed is 0 to {(free_length - shortest) / MILLIMETRE:g} mm"
        )
    middle, shoulder = (bottom + top) / 2, -nose_radius
    front = shoulder - free_length + compression
    # At every compression the stem stays in its bore, and the bore is deep enough for it.
    stem_end, depth = shoulder - 1.1 * free_length, 1.2 * free_length
    n = sides(nose_radius)
    nose = prism(arc(nose_radius, np.pi * (np.arange(n + 1) / n - 0.5)), bottom, top)
    stem = rod(
        np.array([0.0, shoulder / 2, middle]), np.array([0.0, stem_end, middle]), 0.4 * girth
    )
    fraction = np.linspace(0, 1, 32 * TURNS + 1)
    turn = 2 * np.pi * TURNS * fraction
    coil_radius = 0.7 * girth
    helix = np.column_stack(
        [
            coil_radius * np.sin(turn),
            shoulder + (front - shoulder) * fraction,
            middle + coil_radius * np.cos(turn),
        ]
    )
    housing = box(
        np.array([-nose_radius, front - depth, bottom]), np.array([nose_radius, front, top])
    )
    return together([nose, stem, tube(helix, wire, 12), housing])


def pad(
    width: float,
    thickness: float,
    face_radius: float,
    bottom: float,
    top: float,
    dent_depth: float,
    beam_radius: float,
    slope: float = 0.0,
) -> trimesh.Trimesh:
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


def adaptor(offset: Floats, radius: float) -> trimesh.Trimesh:
    """Mesh the rod in Sigma_a from the motor's axis at -offset (3,) to the clamp at the origin."""
    return rod(-offset, np.zeros(3), radius)


def hub(radius: float, bottom: float, top: float) -> trimesh.Trimesh:
    """Mesh the motor's hub: an upright cylinder about the z axis [m]."""
    outline = arc(radius, 2 * np.pi * np.arange(64) / 64) + np.array([0.0, radius])
    return prism(outline, bottom, top)
