"""Sets of photographs: a bent beam of its own integration, OpenCV's camera, and drawn sets."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import BOW, BeamShape
from solver.photographs.fit import Shown
from solver.photographs.photo_set import Photograph, PhotoLoad, PhotoSet, Stated
from solver.tracing.beam_fit import TracedBeam

WIDTH, HEIGHT = 4000, 3000
LENGTH, RIGIDITY = 0.4, 0.05


class Force(NamedTuple):
    """A force [N] at an arc length [m]: of a weight, or across the beam with a friction ratio."""

    kind: str
    size: float
    at: float
    friction: float = 0.0


@dataclass(frozen=True)
class TrueBeam:
    """The beam of all photographs, in SI units; the bow is that of the line at rest, over L."""

    length: float = LENGTH
    rigidity: float = RIGIDITY
    widths: tuple[float, ...] = ()
    bow: tuple[float, ...] = (0.0,) * BOW
    softness: float = 0.0
    down: float = -math.pi / 2

    def curvature(self, s: float) -> float:
        """Compute the curvature at rest [1/m]."""
        t = s / self.length
        return sum((j + 2) * (j + 1) * b * t**j for j, b in enumerate(self.bow)) / self.length

    def rigidity_at(self, s: float) -> float:
        """Compute EI [N m^2]."""
        t = s / self.length
        if not self.widths:
            return self.rigidity
        series = np.polynomial.legendre.legval(2 * t - 1, self.widths)
        return self.rigidity * float(1 + t * series) ** 4


@dataclass(frozen=True)
class TrueCamera:
    """A camera: focal length [px], k1, and one photograph's pose against plane C."""

    focal: float = 3000.0
    k1: float = 0.0
    roll: float = 0.0
    view: tuple[float, float] = (0.0, 0.0)
    distance: float = 0.45
    aim: tuple[float, float] = (0.5, 0.0)  # place in the middle of the image, over L
    size: tuple[int, int] = (WIDTH, HEIGHT)

    def pixels(self, places: Floats, length: float) -> Floats:
        """Project places (n, 2) [m] of plane C to pixels (n, 2)."""
        turns = [(0.0, 0.0, self.roll), (self.view[0], 0.0, 0.0), (0.0, self.view[1], 0.0)]
        rotation = np.eye(3)
        for turn in turns:
            rotation = rotation @ cv2.Rodrigues(np.array(turn))[0]
        rotation = rotation @ np.diag([1.0, -1.0, -1.0])
        shift = [0.0, 0.0, self.distance] - rotation @ [*np.multiply(self.aim, length), 0.0]
        middle = (np.array(self.size) - 1) / 2
        matrix = np.array([[self.focal, 0, middle[0]], [0, self.focal, middle[1]], [0, 0, 1.0]])
        lens = np.array([self.k1, 0.0, 0.0, 0.0, 0.0])
        points = np.column_stack([places, np.zeros(len(places))])
        return np.asarray(cv2.projectPoints(points, rotation, shift, matrix, lens)[0][:, 0])


class Bent(NamedTuple):
    """Rows (n, 4) of x, y, the tangent's angle and the moment, and that at the load (4,)."""

    rows: Floats
    at_load: Floats


def _integrated(beam: TrueBeam, force: Floats, at: float, start: Floats, arcs: Floats) -> Bent:
    def loaded(s: float, y: Floats) -> list[float]:
        cosine, sine = math.cos(y[2]), math.sin(y[2])
        bend = beam.curvature(s) + y[3] / beam.rigidity_at(s)
        return [cosine, sine, bend, sine * force[0] - cosine * force[1]]

    def free(s: float, y: Floats) -> list[float]:
        return [math.cos(y[2]), math.sin(y[2]), beam.curvature(s), 0.0]

    parts, y, at_load = [], start, start
    for rates, a, b in ((loaded, 0.0, at), (free, at, beam.length)):
        own = arcs[(arcs >= a) & (arcs < b)] if b < beam.length else arcs[arcs >= a]
        if a < b:
            found = solve_ivp(rates, (a, b), y, "DOP853", rtol=1e-10, atol=1e-13, dense_output=True)
            parts += [found.sol(np.minimum(own, b)).T] if len(own) else []
            y = found.y[:, -1]
        at_load = y if b == at else at_load
    return Bent(np.vstack(parts), at_load)


def bent(beam: TrueBeam, load: Force | None, tilt: float, arcs: Floats) -> Bent:
    """Integrate the beam from the clamp, by shooting, to increasing arc lengths (n,) [m]."""
    if load is None:
        return _integrated(beam, np.zeros(2), 0.0, np.array([0.0, 0.0, tilt, 0.0]), arcs)
    unit = load.size * load.at

    def shape(moment: float, direction: float) -> Bent:
        force = load.size * np.array([math.cos(direction), math.sin(direction)])
        turn = tilt + beam.softness * moment * beam.length / beam.rigidity
        return _integrated(beam, force, load.at, np.array([0.0, 0.0, turn, moment]), arcs)

    def errors(unknown: Floats) -> list[float]:
        _, at_load = shape(unit * unknown[0], unknown[1])
        across = at_load[2] + math.pi / 2 - math.atan(load.friction)
        direction = beam.down if load.kind == "weight" else across
        return [at_load[3] / unit, unknown[1] - direction]

    first = beam.down if load.kind == "weight" else math.pi / 2
    solution = root(errors, [math.sin(first), first], tol=1e-11)
    assert solution.success, solution.message
    return shape(unit * solution.x[0], solution.x[1])


class Truth(NamedTuple):
    """True load of a photograph, its contact's x, y [m] in plane C, and the tilt [rad]."""

    load: Force | None
    contact: Floats
    tilt: float


class Noise(NamedTuple):
    """Errors [px] of the beam's points and of the marks."""

    points: float = 0.15
    marks: float = 1.0


NOISE = Noise()


def photograph(
    beam: TrueBeam,
    camera: TrueCamera,
    load: Force | None,
    tilt: float,
    rng: np.random.Generator,
    noise: Noise = NOISE,
    marks: int = 0,
    name: str = "photo.jpg",
) -> tuple[Photograph, Shown, Truth]:
    """Photograph a beam; its marks are on a rectangle about it. The load is not stated."""
    arcs = np.linspace(0.01, 0.99, 250) * beam.length
    shape = bent(beam, load, tilt, np.append(arcs, beam.length))
    pixels = camera.pixels(shape.rows[:, :2], beam.length)
    tangents = np.gradient(pixels, axis=0)[:-1]
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    sigmas = np.full(len(arcs), max(noise.points, 1e-3))
    points = pixels[:-1] + noise.points * rng.standard_normal(len(arcs))[:, None] * normals
    corners = np.array([[0.0, 0.1], [1.0, 0.1], [1.0, -0.3], [0.0, -0.3], [0.5, 0.1], [0.5, -0.3]])
    places = corners[:marks] * beam.length

    def marked(of: Floats) -> Floats:
        return camera.pixels(of, beam.length) + noise.marks * rng.standard_normal((len(of), 2))

    ends = marked(np.array([[0.0, 0.0], shape.rows[-1, :2]]))
    photo = Photograph(
        path=Path(name),
        clamp=ends[0],
        tip=ends[1],
        marks=np.column_stack([marked(places), places]) if marks else np.zeros((0, 4)),
        load=None if load is None else PhotoLoad(load.kind),
    )
    # A beam whose width at the clamp is a fiftieth of its length.
    half = 0.01 * beam.length * (np.vectorize(beam.rigidity_at)(arcs) / beam.rigidity) ** 0.25
    angle = shape.rows[:-1, 2]
    across = half[:, None] * np.column_stack([-np.sin(angle), np.cos(angle)])
    edges = [camera.pixels(shape.rows[:-1, :2] + edge, beam.length) for edge in (across, -across)]
    widths = np.linalg.norm(edges[0] - edges[1], axis=1)
    traced = TracedBeam(points, normals, sigmas, widths)
    return photo, Shown(traced, camera.size), Truth(load, shape.at_load[:2], tilt)


class DrawnSet(NamedTuple):
    """Photographs as stated, their traced beams, and the truth."""

    photos: PhotoSet
    shown: list[Shown]
    truth: list[Truth]
    beam: TrueBeam


@dataclass(frozen=True)
class SetSpec:
    """What a drawn set has: numbers of photographs and marks, and what is stated of the loads."""

    rest: int = 2
    loads: int = 3
    kind: str = "weight"
    marks: int = 0
    known_forces: int = 1
    known_places: bool = True
    rigidity_stated: bool = True
    noise: Noise = NOISE
    spread: float = 1.0  # of everything that is drawn, over its stated sigma


def drawn_set(seed: int, spec: SetSpec) -> DrawnSet:
    """Draw a set from the priors that it states."""
    rng = np.random.default_rng(seed)

    def normal(sigma: float) -> float:
        return spec.spread * sigma * float(np.clip(rng.standard_normal(), -2.5, 2.5))

    length = LENGTH * (1 + normal(1e-3))
    beam = TrueBeam(
        length=length,
        rigidity=RIGIDITY * (1 + normal(0.2)),
        bow=(normal(0.006), normal(0.006), normal(0.006)),
        down=-math.pi / 2 + normal(math.radians(0.5)),
    )
    focal, k1, items = 3000 * (1 + normal(0.1)), normal(0.05), []
    for i in range(spec.rest + spec.loads):
        load, at = None, rng.uniform(0.4, 0.95)
        if i >= spec.rest:
            tip = rng.uniform(0.05, 0.35)
            size = tip * 6 / (at**2 * (3 - at)) * RIGIDITY / length**2
            load = Force(spec.kind, size, at * length)
        camera = TrueCamera(
            focal=focal,
            k1=k1,
            roll=normal(math.radians(10)),
            view=(normal(math.radians(5)), normal(math.radians(5))),
            distance=rng.uniform(1.05, 1.4) * length * focal / 3600,
            aim=(0.5 + normal(0.03), -0.1 + normal(0.03)),
        )
        tilt = normal(math.radians(1))
        name = f"{i}.jpg"
        photo, shown, truth = photograph(
            beam, camera, load, tilt, rng, spec.noise, spec.marks, name
        )
        if load:
            stated = PhotoLoad(
                load.kind,
                Stated(load.size * (1 + normal(0.002)), 0.002 * load.size)
                if i - spec.rest < spec.known_forces
                else None,
                Stated(load.at + normal(1e-3), 1e-3) if spec.known_places else None,
            )
            photo = replace(photo, load=stated)
        items.append((photo, shown, truth))
    photos = PhotoSet(
        photographs=tuple(item[0] for item in items),
        length=Stated(LENGTH, 1e-3 * LENGTH),
        rigidity=Stated(RIGIDITY, 0.2 * RIGIDITY) if spec.rigidity_stated else None,
        shape=BeamShape(),
        focal=Stated(3000.0, 300.0),
        k1=Stated(0.0, 0.05),
        mark_sigma=max(spec.noise.marks, 0.01),
    )
    return DrawnSet(photos, [item[1] for item in items], [item[2] for item in items], beam)
