"""A Mitsuba scene that is loaded once; afterwards only vertices move.

Mitsuba offsets rays from surfaces by about 1e-4 of the size of the coordinates, whatever the unit.
In metres this would be a quarter of the beam's radius. The scene is therefore built in units of
that radius, with the origin at the beam's middle.
"""

import gc
import weakref
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from vbaa_bench.geometry.tube import sides
from vbaa_bench.render.affected_pixels import View, pieces
from vbaa_bench.render.camera import sensor_dict
from vbaa_bench.render.device_array import device_array
from vbaa_bench.render.hidden_strip import HiddenStrip
from vbaa_bench.render.lights import emitter, rectangle_pose
from vbaa_bench.render.loading import load
from vbaa_bench.render.optics import Lens, Optics
from vbaa_bench.render.printed_edges import PrintedEdges
from vbaa_bench.render.silhouette import Silhouette
from vbaa_bench.render.surface import RenderUnit, Surface, painted_meshes
from vbaa_bench.render.variant import is_scalar, uses_optix
from vbaa_bench.scene.lights.emitter import Emitter

# Range of depths for which defocus is computed, as ratios to the depth of focus.
_NEAR, _FAR = 0.3, 3.0
# Number of recordings of a frozen function that are kept.
_RECORDINGS = 8


def _without_garbage_collection(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function during which Python's cyclic garbage collector does not run.

    A scene that is freed while Dr.Jit records a function ends the process.
    """

    def call(*arguments: Any) -> Any:
        was_enabled = gc.isenabled()
        gc.disable()
        try:
            return function(*arguments)
        finally:
            if was_enabled:
                gc.enable()

    return call


class World:
    """The full scene of surfaces, lights and a camera, and the still scene without moving surfaces.

    Mitsuba's variant must be set beforehand (`mi.set_variant`). The index of a surface in the
    truth layers is its place in `surfaces`, counted from 1; 0 means no surface. Surfaces named in
    `still` do not move against the camera. Those in `sliding` move only within the common plane of
    these surfaces, such as a patterned ground that turns under the camera; `sliding` holds them as
    they are in the still scene. `bounces` is the number of bounces of light. `lens` is in metres.
    `shadow_places` is the number of places in a pixel at which a set of samples measures shadows.
    `printed` are the edges in an image of a calibration board. `arc_length` [m] is that of the
    beam's vertices, if the scene has a beam.
    """

    def __init__(
        self,
        camera: Camera,
        lights: Emitter | Sequence[Emitter],
        surfaces: Mapping[str, Surface],
        unit: RenderUnit,
        *,
        still: Collection[str] = (),
        sliding: Mapping[str, Surface] | None = None,
        bounces: int = 1,
        shadow_places: int = 1,
        lens: Lens | None = None,
        printed: PrintedEdges | None = None,
    ) -> None:
        self.camera, self.unit, self.bounces = camera, unit, bounces
        self.shadow_places = shadow_places
        self.lens = lens or Lens()
        self.printed = None if self._is_blurred else printed
        if is_scalar() and (camera.distortion or self.lens.point_spread_px or self.lens.aperture):
            raise InputError(
                "this Mitsuba variant cannot distort, spread or defocus light: choose another than "
                "scalar_rgb"
            )
        self.lights = (lights,) if isinstance(lights, Emitter) else tuple(lights)
        self.names = tuple(surfaces)
        self.moving = frozenset(surfaces) - frozenset(still)
        self.sliding = frozenset(sliding or ())
        self.vertices = {name: np.asarray(s.mesh.vertices) for name, s in surfaces.items()}
        self._surfaces = dict(surfaces)
        self.arc_length = surfaces["beam"].arc_length if "beam" in surfaces else None
        self._meshes = painted_meshes(surfaces, unit)
        self.scene = self._scene(self._meshes)
        fixed = {name: s for name, s in surfaces.items() if name in still} | dict(sliding or {})
        self._still_meshes = painted_meshes(fixed, unit)
        self.still = self._scene(self._still_meshes)
        self.sensor = self.scene.sensors()[0]
        self.integrator = self.scene.integrator()
        axis = camera.camera_from_antenna[2, :3]
        self.optics = Optics(camera, self.lens.scaled(1 / unit.unit), self.sensor, axis)
        self.parameters = mi.traverse(self.scene)
        self.view = View(camera)
        self.pieces = {name: pieces(surfaces[name].mesh.faces) for name in self.moving}
        self._frozen: dict[Callable[..., Any], Callable[..., Any]] = {}
        self._has_moved = False

    def _scene(self, meshes: Mapping[str, Any]) -> Any:
        """Load the lights and some meshes as a Mitsuba scene."""
        matrix = self.unit.render_from_antenna
        sensor = sensor_dict(self.camera, matrix)
        sensor["to_world"] = mi.ScalarTransform4f(sensor["to_world"])
        emitters = {f"light_{i}": emitter(light, matrix) for i, light in enumerate(self.lights)}
        integrator = {"type": "path", "max_depth": self.bounces + 1}
        parts = {"sensor": sensor, "integrator": integrator, **emitters, **meshes}
        # Robust: no ray slips between two triangles, on one processor and not on another.
        return load({"type": "scene", "embree_use_robust_intersections": True, **parts})

    @property
    def beam_index(self) -> int | None:
        """Index of the beam in the truth layers; None without a beam."""
        return self.names.index("beam") + 1 if "beam" in self.names else None

    @property
    def blur_px(self) -> int:
        """Largest distance [px] by which the lens blurs a moving surface."""
        pose = self.camera.camera_from_antenna[2]
        depths = [self.vertices[name] @ pose[:3] + pose[3] for name in self.moving]
        if not depths:
            return 0
        # Surfaces beyond these depths are out of view.
        nearest = max(min(d.min() for d in depths), _NEAR * self.lens.focus)
        farthest = min(max(d.max() for d in depths), _FAR * self.lens.focus)
        return self.lens.blur_px(self.camera, float(nearest), float(farthest))

    @property
    def _is_blurred(self) -> bool:
        return self.lens.point_spread_px > 0 or self.lens.aperture > 0

    @cached_property
    def silhouette(self) -> Silhouette | None:
        """The beam's silhouette; None without a beam or a sharp image of it."""
        beam = self._surfaces.get("beam")
        if beam is None or not beam.facets or self._is_blurred:
            return None
        return Silhouette.of(sides(self.vertices["beam"], beam.facets), self.camera)

    @cached_property
    def hidden_strips(self) -> dict[str, HiddenStrip]:
        """The strips of rectangular lamps that the beam hides, by the lamp's name in Mitsuba."""
        beam, strips = self._surfaces.get("beam"), {}
        if beam is None or not beam.facets:
            return {}
        rings = self.unit(sides(self.vertices["beam"], beam.facets))
        for number, light in enumerate(self.lights):
            pose = None
            if light.sheet is not None:
                pose = rectangle_pose(light.sheet, self.unit.render_from_antenna)
            strip = None if pose is None else HiddenStrip.of(rings, pose)
            if strip is not None:
                strips[f"light_{number}"] = strip
        return strips

    def strip(self, emitter: Any) -> HiddenStrip | None:
        """Return the strip of Mitsuba's emitter that the beam may hide; None if it is unknown."""
        shape = emitter.get_shape()
        return None if shape is None else self.hidden_strips.get(shape.id())

    def replayed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return function(world, *arrays) of Dr.Jit without its first argument.

        Once surfaces have moved, it is traced in its first call; later calls repeat its kernels.
        """
        # The transform of Mitsuba's orthographic sensor is hidden from Dr.Jit: it cannot be frozen.
        if not self._has_moved or self.camera.telecentric or uses_optix():
            return partial(function, self)
        if function not in self._frozen:
            # The first argument holds the arrays on which the function depends as well. The world
            # owns the function: were it owned by it, too, it would stay in memory, and its
            # materials in the kernels of other worlds, until garbage is collected.
            world = weakref.proxy(self)
            self._frozen[function] = _without_garbage_collection(
                dr.freeze(lambda _, *arrays: function(world, *arrays), limit=_RECORDINGS)
            )
        return partial(self._frozen[function], self._state)

    @property
    def _state(self) -> Any:
        """All arrays of Dr.Jit, and what else changes as surfaces move."""
        edges = None if self.silhouette is None else self.silhouette.state
        strips = {name: strip.state for name, strip in self.hidden_strips.items()}
        return self.scene, self.still, self.optics.state, edges, strips

    @property
    def grounds(self) -> list[float]:
        """Heights [m] of the lowest point of the still scene, and of its level sheets."""
        points = [self.vertices[name][:, 2] for name in self._still_meshes]
        levels = [float(z.min()) for z in points if np.ptp(z) < 1e-9]
        lowest = min((float(z.min()) for z in points), default=0.0)
        return [lowest, *(z for z in sorted(set(levels)) if z > lowest + 1e-9)]

    def index_of(self, si: Any, *, still: bool = False) -> Any:
        """Find the index (Dr.Jit, UInt32) of the surface met, in the full or the still scene."""
        result = mi.UInt32(0)
        meshes = self._still_meshes if still else self._meshes
        for index, name in enumerate(self.names, start=1):
            if name in meshes:
                result = dr.select(si.shape == mi.ShapePtr(meshes[name]), index, result)
        return result

    def scalar_index(self, si: Any, *, still: bool = False) -> int:
        """Find the index of the surface met by a single interaction, on a scalar variant."""
        meshes = self._still_meshes if still else self._meshes
        matches = (i for i, n in enumerate(self.names, 1) if n in meshes and si.shape == meshes[n])
        return next(matches, 0) if si.is_valid() else 0

    def moves(self, index: Any) -> Any:
        """Test whether the surfaces of a Dr.Jit index move; sliding ones do not count."""
        moving = mi.Bool(False)
        for name in self.moving - self.sliding:
            moving |= index == self.names.index(name) + 1
        return moving

    def bodies(self, names: Collection[str]) -> list[Floats]:
        """Return the vertices (n, 3) [m] of each piece of moving surfaces, for convex hulls."""
        return [self.vertices[name][piece] for name in names for piece in self.pieces[name]]

    def move(self, vertices: Mapping[str, Floats], arc_length: Floats | None = None) -> None:
        """Set new vertices (n, 3) [m] of some surfaces, and the beam's arc lengths [m].

        The topology is kept; raises ValueError if the number of vertices changes. Vertices of still
        surfaces are ignored.
        """
        for name, new in vertices.items():
            if len(new) != len(self.vertices[name]):
                raise ValueError(f"{name} has {len(self.vertices[name])} vertices, got {len(new)}")
            if name in self.moving:
                self.vertices[name] = new
                for key, value in self._surfaces[name].shape(new, self.unit).items():
                    self.parameters[f"{name}.{key}"] = value
        self._has_moved = True
        for name in ("silhouette", "hidden_strips"):  # of the beam before
            vars(self).pop(name, None)
        if arc_length is not None:
            self.arc_length = arc_length
            texcoords = self._surfaces["beam"].beam_texcoords(arc_length)
            self.parameters["beam.vertex_texcoords"] = device_array(texcoords)
        self.parameters.update()
