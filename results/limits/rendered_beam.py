"""Derivatives of the expected image of a beam, from renders of the displaced mesh.

The mesh is moved along and against the displacement that a parameter causes, and the image is
rendered with the same random numbers. Samples of a pixel keep their places relative to the beam's
edges (`render.silhouette`), so the difference of two images has little noise. What remains is
independent between two sets of samples: the product of their derivatives is unbiased.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from results.limits.displacement import displacements
from solver.instrument.arrays import Floats, Mask
from solver.instrument.transforms import apply
from vbaa_bench.limits.imaged_beam import FRACTIONS, ImagedBeam, Neighbours
from vbaa_bench.mechanics.state import interpolated
from vbaa_bench.render.pilots import dilated
from vbaa_bench.render.tracing import Quantity, trace
from vbaa_bench.render.world import World

# Largest displacement [px] in the image of a step. Measured on the paper's scenes: with half or
# double this step the limits of x_c, s_c and force change by 1 % in the median, by render noise.
STEP_PX: Final = 0.05
# Samples per pixel of each of the two sets. Measured: at 64 the information of one set alone on a
# parameter exceeds the product of both by less than 1 %; on combinations of them, see `rendered`.
SAMPLES: Final = 64
# Samples per pixel for the choice of pixels.
_FEW_SAMPLES: Final = 16
# Distance [px] from the beam's ends within which pixels have at least this number of samples,
# because samples at the ends do not follow the edges. Chosen: the derivative of a pixel at the tip
# has an error of 5 %.
_END_PX: Final = 3.0
_END_SAMPLES: Final = 2048


class BeamChange(NamedTuple):
    """Expected image of a beam in n pixels, and its derivatives from two sets of samples.

    `mean` (n,) is the radiance. `slopes` (2, p + 3, n) are its derivatives, per SI unit of p
    parameters and for relative changes of APPEARANCE: brightness of beam and background, width.
    """

    mean: Floats
    slopes: Floats


def near_beam(world: World) -> Mask:
    """Mark the pixels (height, width) that show a part of the beam, and their neighbours."""
    where = world.view.hulls(world.bodies({"beam"}), world.blur_px)
    rows, columns = np.nonzero(where)
    few = np.full(len(rows), _FEW_SAMPLES)
    traced = trace(world, np.column_stack([columns, rows]), few, 0, "whole")
    where[rows, columns] = traced.coverage > 0
    return dilated(where, 1)


def beam_change(
    world: World,
    imaged: ImagedBeam,
    neighbours: Mapping[str, Neighbours],
    pixels: np.ndarray,
    seed: int,
    *,
    step_px: float = STEP_PX,
    samples: int = SAMPLES,
) -> BeamChange:
    """Render the image of a beam in `pixels` (n, 2), integer (column, row), and differentiate it.

    The world shows the beam `imaged`, and shows it again afterwards. The parameters are those of
    `neighbours`. Raises EquilibriumError.
    """
    resting = world.vertices["beam"]
    ends = imaged.pixels[[0, -1]]
    is_end = (np.linalg.norm(pixels[:, None] - ends, axis=2) < _END_PX).any(axis=1)
    size = np.where(is_end, max(samples, _END_SAMPLES), samples)
    # Equal sizes side by side keep the processor's lanes busy.
    order = np.argsort(size, kind="stable")

    def image(vertices: Floats, number: int, quantity: Quantity = "whole") -> Floats:
        world.move({"beam": vertices})
        radiance = np.empty(len(pixels))
        traced = trace(world, pixels[order], size[order], seed + number, quantity)
        radiance[order] = traced.radiance
        return radiance

    moves = _moves(world, imaged, neighbours)
    means, sets = [], []
    for number in range(2):
        slopes = []
        for move, largest_px in zip(moves.metres, moves.largest_px, strict=True):
            step = step_px / largest_px
            ahead, behind = (image(resting + sign * step * move, number) for sign in (1, -1))
            slopes.append((ahead - behind) / (2 * step))
        mean, beam = image(resting, number), image(resting, number, "beam")
        # The width is the last of the moves and the last parameter.
        sets.append([*slopes[:-1], beam, mean - beam, slopes[-1]])
        means.append(mean)
    return BeamChange(np.mean(means, axis=0), np.array(sets))


class _Moves(NamedTuple):
    """Displacements (p + 1, vertices, 3) [m] of the mesh per unit, and their largest in [px]."""

    metres: Floats
    largest_px: Floats


def _moves(world: World, imaged: ImagedBeam, neighbours: Mapping[str, Neighbours]) -> _Moves:
    """Displace the mesh's vertices with their places on the centreline; the last is the width."""
    vertices = world.vertices["beam"]
    line = apply(imaged.frame_from_clamp, imaged.beam.centreline[:, 1:])
    along = displacements(imaged, neighbours)
    spokes = vertices - of_vertices(world, line)
    radii_px = np.linalg.norm(spokes, axis=1) * imaged.camera.pixels_per_metre(vertices)
    return _Moves(
        np.array([*(of_vertices(world, metres) for metres in along.metres), spokes]),
        np.append(along.largest_px, radii_px.max()),
    )


def of_vertices(world: World, rows: Floats) -> Floats:
    """Interpolate rows (n, 3) at FRACTIONS of the beam's length to the vertices of its mesh."""
    assert world.arc_length is not None
    share = world.arc_length / world.arc_length.max()
    return interpolated(share, FRACTIONS, rows)
