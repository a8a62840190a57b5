"""Beams drawn in numpy, without meshes, rays or profile tables: a road of its own to their images.

A pixel's value is the mean of the scene over the pixel and the lens's spread: over a lattice of
points, each of which lies on the beam or beside it.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.special import ndtr

from solver.centreline.guide import Guide
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.camera import Camera
from solver.instrument.transforms import turn_about_z

METRES_PER_PIXEL = 0.5e-3
LENGTH, RADIUS = 0.140, 0.4e-3
WIDTH, HEIGHT = 320, 128
TIPS = ("square", "rounded", "oblique", "faded")
FADED_PX = 2.0
# Points that are evaluated at once. Chosen: more exceed the processor's cache.
_AT_ONCE = 60_000


@dataclass(frozen=True)
class Sensor:
    """Full well and read noise [electrons], and bits; the full well is full scale."""

    full_well: float = 10_000
    read_noise: float = 10.0
    bits: int = 8

    def __call__(self, light: Floats, random: np.random.Generator) -> Grey:
        """Gray values of light (height, width), in shares of full scale."""
        electrons = np.maximum(light, 0) * self.full_well
        noisy = electrons + random.standard_normal(light.shape) * np.sqrt(
            electrons + self.read_noise**2
        )
        top = 2**self.bits - 1
        gray = np.clip(np.rint(noisy / self.full_well * top), 0, top)
        return np.asarray(gray, np.uint8) if self.bits == 8 else np.asarray(gray, np.uint16)

    def sigma(self, light: float) -> float:
        """Scatter of a pixel [gray], rounding included."""
        electrons = np.sqrt(light * self.full_well + self.read_noise**2)
        return float(np.hypot(electrons / self.full_well * (2**self.bits - 1), 12**-0.5))


@dataclass(frozen=True)
class Look:
    """How the beam looks: brightness of its middle and of the ground, in shares of full scale.

    `tip` is one of TIPS: the free end is cut square, rounded off, cut at 45 degrees, or square
    and shaded over its last FADED_PX. `taper` is the difference of the radii at tip and clamp, over
    that in the middle.
    """

    beam: float = 0.9
    ground: float = 0.05
    radius_px: float = RADIUS / METRES_PER_PIXEL
    spread_px: float = 0.5
    roundness: float = 0.6
    skew: float = 0.0
    tip: str = "square"
    taper: float = 0.0

    @property
    def dark(self) -> "Look":
        """The same beam, lit from behind."""
        return replace(self, beam=0.1, ground=0.6)


def camera(roll: float, width: int, height: int) -> Camera:
    """A telecentric camera before a beam clamped 20 px from the left, turned by `roll` [rad].

    Rolled by more than 45 degrees the image stands on its side.
    """
    pose = turn_about_z(roll) @ np.diag([1.0, -1.0, -1.0, 1.0])
    if abs(np.sin(roll)) > 0.8:
        width, height = height, width
    elif abs(np.sin(roll)) > 0.5:
        width = height = max(width, height)
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    middle = pose[:2, :2] @ [LENGTH / 2, 0.0]
    cx, cy = centre - middle / METRES_PER_PIXEL
    fx = 1 / METRES_PER_PIXEL
    return Camera(width, height, fx, fx, float(cx), float(cy), pose, telecentric=True)


def guide(roll: float = 0.0, width: int = WIDTH, height: int = HEIGHT) -> Guide:
    """The guide of a rig whose beam's frame is Sigma_a, before a camera rolled by `roll` [rad]."""
    return Guide(camera(roll, width, height), np.eye(4), LENGTH, RADIUS)


def bent(theta: float, s_c: float = 0.6, tilt: float = 0.0, offset: float = 0.0) -> Floats:
    """Places (n, 2) [m] of a beam clamped at x = 0, pushed at s_c of its length.

    Its tangent turns by `theta` [rad] up to there, as under a force at its end, and no further.
    `tilt` [rad] and `offset` [m] of the clamp.
    """
    s = np.linspace(0, LENGTH, 4001)
    angle = tilt + theta * (1 - np.clip(1 - s / (s_c * LENGTH), 0, 1) ** 2)
    step = s[1] - s[0]
    x, y = (
        np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2) * step])
        for f in (np.cos(angle), np.sin(angle))
    )
    return np.column_stack([x, y + offset])


def longer(shape: Floats, by: float) -> Floats:
    """Places (n, 2) [m] of a beam that goes straight on, `by` [m] further than this shape."""
    towards = (shape[-1] - shape[-2]) / np.hypot(*(shape[-1] - shape[-2]))
    return np.vstack([shape, shape[-1] + np.linspace(0.01, 1, 20)[:, None] * by * towards])


def cover(
    pixels: Floats, look: Look, shape: tuple[int, int], points: int = 987, generator: int = 610
) -> tuple[Floats, Floats]:
    """Share of every pixel (height, width) that a beam along `pixels` (n, 2) covers, and its light.

    The light is that of a beam whose middle shines with 1. Tests draw many images of one shape:
    the last ones are kept.
    """
    return _cover(np.ascontiguousarray(pixels).tobytes(), look, shape, points, generator)


@lru_cache(maxsize=64)
def _cover(
    line_of_pixels: bytes, look: Look, shape: tuple[int, int], points: int, generator: int
) -> tuple[Floats, Floats]:
    pixels = np.frombuffer(line_of_pixels).reshape(-1, 2)
    step = np.hypot(*np.diff(pixels, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(step)])
    curve = CubicSpline(s, pixels)
    fine = np.arange(0, s[-1], 0.05)
    line, tangent, bend = curve(fine), curve(fine, 1), curve(fine, 2)
    curvature = tangent[:, 0] * bend[:, 1] - tangent[:, 1] * bend[:, 0]
    du, dv = _lattice(look.spread_px, points, generator)
    reach = look.radius_px * (1 + abs(look.taper) / 2) + float(np.hypot(du, dv).max())
    v, u = np.mgrid[: shape[0], : shape[1]]
    centres = np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)
    away, nearest = cKDTree(line).query(centres, distance_upper_bound=reach + 0.1)
    which = np.flatnonzero(np.isfinite(away))
    covered, shining = np.zeros(len(centres)), np.zeros(len(centres))
    for some in np.array_split(which, max(1, len(which) * points // _AT_ONCE)):
        k = nearest[some]
        x = centres[some, 0, None] + du - line[k, 0, None]
        y = centres[some, 1, None] + dv - line[k, 1, None]
        along = x * tangent[k, 0, None] + y * tangent[k, 1, None]
        # To second order about the nearest place of the line, which a pixel's width allows.
        across = y * tangent[k, 0, None] - x * tangent[k, 1, None]
        across -= curvature[k, None] * along**2 / 2
        place = fine[k, None] + along
        r = across / (look.radius_px * (1 + look.taper * (place / s[-1] - 0.5)))
        before_tip = _before_tip(s[-1] - place, r, look)
        inside = (np.abs(r) < 1) & (place > 0) & (before_tip > 0)
        shine = np.zeros(r.shape)
        shine[inside] = np.clip(1 - r[inside] ** 2, 0, 1) ** (look.roundness / 2)
        if look.tip == "faded":
            shine *= np.clip(before_tip / FADED_PX, 0, 1)
        covered[some] = inside.mean(axis=1)
        shining[some] = (shine * (1 + look.skew * r)).mean(axis=1)
    for each in (covered, shining):
        each.setflags(write=False)
    return covered.reshape(shape), shining.reshape(shape)


def _before_tip(before_end: Floats, r: Floats, look: Look) -> Floats:
    """Measure along the beam to its tip [px], from `before_end` [px] and r radii off the axis."""
    if look.tip == "rounded":
        return before_end - look.radius_px * (1 - np.sqrt(np.clip(1 - r**2, 0, 1)))
    if look.tip == "oblique":
        return before_end - look.radius_px * (1 + r)
    return before_end


def _lattice(spread: float, points: int, generator: int) -> tuple[Floats, Floats]:
    """Offsets (n,) [px] spread evenly over pixel * Gaussian: a Fibonacci lattice, warped."""
    at = np.linspace(-0.5 - 5 * spread, 0.5 + 5 * spread, 4001)
    if spread > 0:
        # The integral of a box of width one smeared by a Gaussian.
        def integral(t: Floats) -> Floats:
            z = t / spread
            return np.asarray(
                t * ndtr(z) + spread * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi), np.float64
            )

        share = integral(at + 0.5) - integral(at - 0.5)
    else:
        share = np.clip(at + 0.5, 0, 1)
    number = np.arange(points)
    a, b = (number + 0.5) / points, (number * generator % points + 0.5) / points
    return np.interp(a, share, at), np.interp(b, share, at)


def drawn(
    seen_by: Guide,
    places: Floats,
    look: Look = Look(),
    ground: Floats | float | None = None,
    hidden: Mask | None = None,
    occluder: float = 0.1,
) -> Floats:
    """Light (height, width) of a beam along places (n, 2) [m] of the guide's frame.

    `ground` replaces the look's even one; where `hidden`, an `occluder` stands before it all.
    """
    shape = (seen_by.camera.height, seen_by.camera.width)
    covered, shining = cover(seen_by.pixels(places), look, shape)
    behind = np.broadcast_to(look.ground if ground is None else ground, shape)
    light = behind * (1 - covered) + look.beam * shining
    return np.asarray(light if hidden is None else np.where(hidden, occluder, light))


def distances(points: Floats, pixels: Floats) -> Floats:
    """Signed distances (m,) [px] of points (m, 2) from a dense line of pixels (n, 2)."""
    step = np.hypot(*np.diff(pixels, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(step)])
    curve = CubicSpline(s, pixels)
    _, nearest = cKDTree(pixels).query(points)
    place = s[nearest]
    for _ in range(3):
        place = place + np.einsum("ij,ij->i", points - curve(place), curve(place, 1))
    off, tangent = points - curve(place), curve(place, 1)
    return np.asarray(off[:, 1] * tangent[:, 0] - off[:, 0] * tangent[:, 1])
