"""Assembly of a scene's meshes, lights and camera into worlds that can be rendered."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, rigid
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.assembly.beam_mesher import BeamMesher
from vbaa_bench.assembly.clamp import HOLDER, holder_surfaces
from vbaa_bench.assembly.clutter import CLUTTER, clutter_surfaces
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.ground import Ground
from vbaa_bench.assembly.occlusion import occluder_mesh
from vbaa_bench.assembly.part_textures import beam_texture, object_texture
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.wires import WIRES, wires_surface
from vbaa_bench.geometry.board import board, cells
from vbaa_bench.geometry.textures import Texture, unshared
from vbaa_bench.geometry.tip import TIPS
from vbaa_bench.mechanics.state import State
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.optics import Lens
from vbaa_bench.render.printed_edges import PrintedEdges
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.world import World
from vbaa_bench.scene.background import GROUND
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig, nominal_rig
from vbaa_bench.scene.schema import Scene

# Reflectance of the board's card and of the ink on it.
WHITE, BLACK = 0.7, 0.04


@dataclass(frozen=True)
class SceneAssembler:
    """Assembler of worlds of one scene's true rig, in the frame in which the camera is fixed.

    The random patterns of surfaces are numbered: `static_pattern_id` is that of surfaces that do
    not move, `moving_pattern_id` that of surfaces that do, and `grime_id` that of the beam's grime;
    each is 0 if all frames have the same pattern.
    Ground and clutter are those of `still_scene`, by default the scene itself: frames that share
    them may have other objects.
    """

    scene: Scene
    rig: TrueRig
    folder: Path
    static_pattern_id: int = 0
    moving_pattern_id: int = 0
    grime_id: int = 0
    still_scene: Scene | None = None

    def rest(self, experiment: Experiment) -> World:
        """Build the world of the beam at rest, without an object."""
        return self._world(dict(self._antenna_and_ground(experiment, experiment.rest, 0.0)))

    def without_beam(self, experiment: Experiment) -> World:
        """Build the world before the beam is mounted."""
        surfaces = dict(self._antenna_and_ground(experiment, experiment.rest, 0.0))
        del surfaces["beam"]
        return self._world(surfaces)

    def pushed_world(self, pose: Pose) -> World:
        """Build the world of the beam pushed against its object."""
        return self._world(self.surfaces(pose))

    def surfaces(self, pose: Pose) -> dict[str, Surface]:
        """Build all surfaces of a frame.

        Those of the beam at rest come first: the indices of surfaces in the layers of the truth
        must be the same with and without an object, as both share the static layer.
        """
        antenna = self._antenna_and_ground(pose.experiment, pose.state, pose.motor_angle)
        return {**dict(antenna), **dict(self.object_surfaces(pose))}

    def repose(self, world: World, pose: Pose) -> None:
        """Move the vertices of a world, made by `pushed_world`, to another pose."""
        surfaces = self.surfaces(pose)
        vertices = {name: np.asarray(surface.mesh.vertices) for name, surface in surfaces.items()}
        world.move(vertices, surfaces["beam"].arc_length)

    def centreline(self, pose: Pose) -> Floats:
        """Compute the beam's arc length and position (n, 4) [m] in the fixed camera's frame."""
        line = pose.state.centreline
        return np.column_stack(
            [
                line[:, 0],
                apply(self._frame_from_clamp(pose.experiment, pose.motor_angle), line[:, 1:]),
            ]
        )

    def calibration_board(self, view: int) -> World:
        """Build the world of the calibration board: in plane C in view 0, tilted in the others."""
        antenna_from_board = self.antenna_from_board(view)
        target = nominal_rig(self.scene).board
        white, black = (_placed(mesh, antenna_from_board) for mesh in board(target))
        edges = PrintedEdges.of(*cells(target), antenna_from_board, self.rig.camera)
        surfaces = {"white": Surface(white, WHITE), "black": Surface(black, BLACK)}
        # A luminous panel would be at the board's position.
        return self._world(surfaces, lights(self.scene, self.folder, panels=False), edges)

    def antenna_from_board(self, view: int) -> Floats:
        """Compute the true pose (4, 4) of the calibration board in a view."""
        return self.rig.antenna_from_board @ _board_tilt(self.scene, view)

    def _antenna_and_ground(
        self, experiment: Experiment, state: State, motor_angle: float
    ) -> Iterator[tuple[str, Surface]]:
        """Yield the surfaces of the antenna and of the background."""
        scene, spec = self.scene, self.scene.beam
        frame_from_clamp = self._frame_from_clamp(experiment, motor_angle)
        mesh, s = self._beam_mesher.mesh(state)
        beam = Surface.of(_placed(mesh, frame_from_clamp), spec)
        beam = replace(
            beam,
            arc_length=s,
            smooth=not spec.section_shape.is_flat,
            oblique_tip=TIPS[spec.tip].oblique,
        )
        if spec.grime is not None:
            around = self._beam_mesher.around(s)
            beam = replace(beam, texture=self._grime, around=around)
        yield "beam", beam
        for name, surface in holder_surfaces(scene):
            yield name, replace(surface, mesh=_placed(surface.mesh, frame_from_clamp))
        yield from self._background(experiment, motor_angle)

    def object_surfaces(self, pose: Pose) -> Iterator[tuple[str, Surface]]:
        """Yield the surfaces that the beam is pushed against, and the occluder."""
        experiment, state, scene = pose.experiment, pose.state, self.scene
        frame_from_clamp, top = self._frame_from_clamp(experiment, pose.motor_angle), 0.0
        if scene.object.present:
            object_mesh = experiment.touched_mesh(state, pose.spec.step)
            top = float(object_mesh.vertices[:, 2].max())
            if self._object_texture is not None:
                object_mesh = unshared(object_mesh)
            assert isinstance(scene.object, PaintedPart)
            surface = Surface.of(_placed(object_mesh, frame_from_clamp), scene.object)
            yield "object", replace(surface, texture=self._object_texture)
        second_peg = scene.second_peg
        if second_peg is not None:
            clamp_from_peg = experiment.clamp_from_object(state, pose.spec.step, 1)
            peg = second_peg.peg.mesh(experiment.object_setting._replace(ground=experiment.ground))
            yield (
                "second_peg",
                Surface.of(_placed(peg, frame_from_clamp @ clamp_from_peg), second_peg),
            )
        occlusion = scene.occlusion
        if occlusion is not None and occlusion.occluder is not None:
            cover = pose.spec.cover
            covers = cover is not None and cover.in_image
            stretch = pose.hidden if covers else None
            random = random_generator(scene, "occluder", pose.spec.index)
            camera = self.rig.camera
            camera_from_clamp = camera.camera_from_antenna @ frame_from_clamp
            covered = pose.covered or state
            placeholder = (0.0, 0.1 * self.rig.beam.length)
            mesh = occluder_mesh(
                occlusion, stretch or placeholder, covered, camera, camera_from_clamp, top, random
            )
            if stretch is None:  # shrunk to a point at the hub's foot, hides and shades nothing
                mesh.vertices[:] = (0.0, 0.0, experiment.ground)
            yield "occluder", Surface.of(_placed(mesh, frame_from_clamp), occlusion)

    def _frame_from_clamp(self, experiment: Experiment, motor_angle: float) -> Floats:
        """Compute the transform (4, 4) from the clamp's frame to that of the fixed camera."""
        transform = experiment.camera_frame_from_clamp(motor_angle).copy()
        transform[:3, 3] += self.rig.base_position
        return transform

    def _background(
        self, experiment: Experiment, motor_angle: float
    ) -> Iterator[tuple[str, Surface]]:
        """Yield the surfaces of the ground at a motor angle [rad], and what lies on it."""
        frame_from_ground = np.eye(4)
        if self.scene.ground_turns:
            frame_from_ground = (
                experiment.clamp_from_world(motor_angle)
                if self.scene.camera.mount == "antenna"
                else self._frame_from_clamp(experiment, motor_angle)
            )
        endless = self.scene.background.is_endless
        for name, surface in self._ground.surfaces():
            mesh = _placed(surface.mesh, np.eye(4) if endless else frame_from_ground)
            yield name, replace(surface, mesh=mesh)
        for name, surface in (*self._clutter, *self._wires):
            mesh = _placed(surface.mesh.copy(), frame_from_ground)
            yield name, replace(surface, mesh=mesh)

    @cached_property
    def _ground(self) -> Ground:
        return Ground(self.still_scene or self.scene, self.rig, self.folder, self.static_pattern_id)

    @cached_property
    def _clutter(self) -> list[tuple[str, Surface]]:
        """Surfaces of the clutter in the frame of the ground."""
        scene = self.still_scene or self.scene
        if scene.clutter is None:
            return []
        return list(clutter_surfaces(scene, self.rig, self.folder, self.static_pattern_id))

    @cached_property
    def _wires(self) -> list[tuple[str, Surface]]:
        """Surface of the wires in the frame of the ground."""
        scene = self.still_scene or self.scene
        surface = (
            None if scene.wires is None else wires_surface(scene, self.rig, self.static_pattern_id)
        )
        return [] if surface is None else [(WIRES, surface)]

    @cached_property
    def _beam_mesher(self) -> BeamMesher:
        return BeamMesher(self.scene, self.rig)

    @cached_property
    def _object_texture(self) -> Texture | None:
        return object_texture(self.scene, self.rig, self.folder, self.moving_pattern_id)

    @cached_property
    def _grime(self) -> Texture | None:
        return beam_texture(self.scene, self.rig, self.grime_id)

    @cached_property
    def _lights(self) -> list[Emitter]:
        return lights(self.scene, self.folder)

    def _world(
        self,
        surfaces: dict[str, Surface],
        lamps: list[Emitter] | None = None,
        printed: PrintedEdges | None = None,
    ) -> World:
        optics = self.scene.optics
        lens = Lens(
            optics.point_spread_px,
            optics.aperture_mm / 2 * MILLIMETRE,
            (optics.focus_distance_mm or self._distance_mm) * MILLIMETRE,
        )
        return World(
            self.rig.camera,
            self._lights if lamps is None else lamps,
            surfaces,
            self.unit,
            still=self._still & set(surfaces),
            sliding=dict(self._ground.surfaces()) if self._slides & set(surfaces) else None,
            bounces=self.scene.render.bounces,
            shadow_places=self.scene.render.shadow_places,
            lens=lens,
            printed=printed,
        )

    @property
    def _distance_mm(self) -> float:
        """Distance from the lens to the point it looks at."""
        camera = self.scene.camera
        return math.dist(camera.position_mm, camera.look_at_mm)

    @property
    def _still(self) -> set[str]:
        """Names of surfaces that do not move against the camera; a plain ground always counts."""
        still = set(HOLDER) if self.scene.camera.mount == "antenna" else set()
        if not self.scene.ground_turns:
            still |= {*GROUND, *CLUTTER, WIRES}
        elif self.scene.background.is_endless:
            still |= GROUND
        return still

    @property
    def _slides(self) -> set[str]:
        """Names of the surfaces of a patterned ground that slide as it turns under the camera."""
        return GROUND - self._still if self.scene.background.kind.slides else set()

    @property
    def unit(self) -> RenderUnit:
        """Unit and origin of render coordinates."""
        return RenderUnit.of(self.rig.beam)


def _placed(mesh: trimesh.Trimesh, transform: Floats) -> trimesh.Trimesh:
    """Transform a mesh in place; its vertices keep their order."""
    mesh.vertices = apply(transform, np.asarray(mesh.vertices))
    return mesh


def _board_tilt(scene: Scene, view: int) -> Floats:
    """Draw a view's board pose relative to view 0: tilted about its own x and y axes."""
    if view == 0:
        return np.eye(4)
    random = random_generator(scene, "board view", view)
    max_tilt = scene.calibration.tilt_deg * DEGREE
    # Tilt directions are spread evenly, and no tilt is near zero, as in careful calibration.
    fraction = (view + random.uniform(-0.2, 0.2)) / (scene.calibration.views - 1)
    azimuth = 2 * np.pi * fraction
    angle = max_tilt * random.uniform(0.7, 1.0)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    # Tilting brings one side nearer to the camera; lower the card so that it stays in view.
    lowering = random.uniform(0.12, 0.2) * scene.camera.position_mm[2] * MILLIMETRE
    return rigid(angle * axis, np.array([0.0, 0.0, -lowering]))
