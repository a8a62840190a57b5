"""Photographs of beams drawn in numpy: anti-aliased beams of known centreline on a table.

A pixel of the beam is a function of its distance from the centreline and of its arc length, blurred
by error functions: no polygon, no path search, no profile fit.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.special import ndtr

from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class Look:
    """Appearance of a photograph in gray values (0 to 255) and pixels.

    `grain` and `texture` are standard deviations of the beam's and the table's structure.
    `edge_px` draws a straight edge of the table at this distance from the clamp-tip line;
    `string` a weight's string across the beam, `knots` dark knots within it.
    """

    beam: float = 190.0
    table: float = 90.0
    blur_px: float = 0.8
    noise: float = 2.0
    grain: float = 0.0
    highlight: float = 0.0
    texture: float = 0.0
    edge_px: float | None = None
    string: bool = False
    knots: int = 0
    quality: int = 92


@dataclass(frozen=True)
class Photograph:
    """An image (height, width) and the true centreline (m, 2) from the clamp to the tip [px]."""

    image: Floats
    line: Floats

    def marks(self, random: np.random.Generator, sigma_px: float = 1.0) -> tuple[Floats, Floats]:
        """Clamp and tip, marked with errors."""
        clamp, tip = self.line[0], self.line[-1]
        return (
            clamp + sigma_px * random.standard_normal(2),
            tip + sigma_px * random.standard_normal(2),
        )

    def off(self, points: Floats, normals: Floats) -> Floats:
        """Distances (n,) of points from the centreline along their normals."""
        foot = self.line[cKDTree(self.line).query(points)[1]]
        return np.asarray(np.einsum("ij,ij->i", points - foot, normals))


def centreline(clamp: Floats, heading: float, length: float, bend: float, s_c: float) -> Floats:
    """A bent cantilever (m, 2) [px], of linear theory in its angle; `bend` [rad] is the tip's."""
    s = np.arange(0, length, 0.2)
    r = np.minimum(s / (s_c * length), 1.0)
    angle = heading + bend * (2 * r - r * r)
    steps = 0.2 * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray(clamp + np.cumsum(steps, axis=0) - steps[0])


def photograph_of(
    line: Floats, width_px: float, shape: tuple[int, int], look: Look, random: np.random.Generator
) -> Photograph:
    """Draw the beam of this width along a centreline."""
    image = _table(line, shape, look, random)
    v, u = np.nonzero(_near(line, width_px / 2 + 6 * look.blur_px + 3, shape))
    pixels = np.column_stack([u, v]).astype(float)
    number = cKDTree(line).query(pixels)[1]
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    step = float(np.linalg.norm(line[1] - line[0]))
    difference = pixels - line[number]
    s = number * step + np.einsum("ij,ij->i", difference, tangent[number])
    d = difference[:, 1] * tangent[number, 0] - difference[:, 0] * tangent[number, 1]
    # A pixel's own square blurs as well.
    blur = np.hypot(look.blur_px, 12**-0.5)
    across = ndtr((d + width_px / 2) / blur) - ndtr((d - width_px / 2) / blur)
    cover = across * ndtr((len(line) * step - s) / blur)
    image[v, u] += cover * (_wood(d, s, width_px, look, random) - image[v, u])
    _clamp(image, line[0], tangent[0], width_px)
    if look.string:
        knot = line[int(0.7 * len(line))]
        heading = tangent[int(0.7 * len(line))]
        down = np.array([-heading[1], heading[0]]) + 0.3 * heading
        ends = np.rint([knot - width_px * down, knot + sum(shape) * down]).astype(int)
        thickness = max(1, round(width_px / 8))
        cv2.line(image, tuple(ends[0]), tuple(ends[1]), 40.0, thickness, cv2.LINE_AA)
    noisy = image + look.noise * random.standard_normal(shape)
    whole = np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)
    jpeg = cv2.imencode(".jpg", whole, [cv2.IMWRITE_JPEG_QUALITY, look.quality])[1]
    decoded = cv2.imdecode(jpeg, cv2.IMREAD_UNCHANGED)
    return Photograph(np.asarray(decoded, np.float64), line)


def _near(line: Floats, reach: float, shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    band = np.zeros(shape, np.uint8)
    nodes = np.rint(line[:: max(1, len(line) // 500)]).astype(np.int32)
    cv2.polylines(band, [np.vstack([nodes, np.rint(line[-1:])]).astype(np.int32)], False, 1,
                  thickness=2 * int(np.ceil(reach)) + 3)  # fmt: skip
    return band


def _table(line: Floats, shape: tuple[int, int], look: Look, random: np.random.Generator) -> Floats:
    v, u = np.mgrid[: shape[0], : shape[1]]
    table = look.table * (1 + 0.1 * u / shape[1] - 0.1 * v / shape[0])
    if look.texture:
        for scale in (1.5, 6.0, 25.0):
            field = cv2.GaussianBlur(random.standard_normal(shape), (0, 0), scale)
            table += look.texture / 3**0.5 * field / field.std()
    if look.edge_px is not None:
        chord = line[-1] - line[0]
        normal = np.array([-chord[1], chord[0]]) / np.linalg.norm(chord)
        beyond = (u - line[0, 0]) * normal[0] + (v - line[0, 1]) * normal[1] - look.edge_px
        table += 0.4 * (look.beam - look.table) * ndtr(beyond / look.blur_px)
    return np.asarray(table)


def _wood(d: Floats, s: Floats, width_px: float, look: Look, random: np.random.Generator) -> Floats:
    value = np.full(len(d), look.beam)
    if look.grain:
        # Streaks: fine across, long along.
        rows, columns = int(width_px) + 12, int(s.max() / 8) + 12
        streaks = cv2.GaussianBlur(
            random.standard_normal((rows, columns)), (0, 0), sigmaX=12.0, sigmaY=1.2
        )
        at = [np.clip(s / 8 + 4, 0, columns - 1), np.clip(d + rows / 2, 0, rows - 1)]
        maps = [np.asarray(a, np.float32).reshape(-1, 1) for a in at]
        rolled = np.asarray(streaks / streaks.std(), np.float32)
        parts = [
            cv2.remap(rolled, maps[0][i : i + 30_000], maps[1][i : i + 30_000], cv2.INTER_LINEAR)
            for i in range(0, len(d), 30_000)
        ]
        value += look.grain * np.concatenate(parts)[:, 0]
    if look.highlight:
        value += look.highlight * np.exp(-0.5 * ((d - 0.15 * width_px) / (0.08 * width_px)) ** 2)
    for _ in range(look.knots):
        place, offset = random.uniform(0, s.max()), random.uniform(-0.3, 0.3) * width_px
        far = np.hypot((s - place) / (0.3 * width_px), (d - offset) / (0.2 * width_px))
        value -= 60 * np.exp(-(far**2))
    return value


def _clamp(image: Floats, place: Floats, tangent: Floats, width_px: float) -> None:
    normal = np.array([-tangent[1], tangent[0]])
    half, deep = 1.5 * width_px + 20, 40 + width_px
    corners = [place + half * normal, place - half * normal]
    corners += [corners[1] - deep * tangent, corners[0] - deep * tangent]
    cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), 60.0, cv2.LINE_AA)
