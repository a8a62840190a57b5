"""The set: a scene's meshes, lamp and camera put up as worlds that can be rendered."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, rigid
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.board import board
from vbaa_bench.geometry.objects import block, hub, sheet
from vbaa_bench.geometry.tube import arc_length_of_vertices, tube
from vbaa_bench.mechanics.planar import Equilibrium, at_rest
from vbaa_bench.render.world import Lamp, RenderUnit, Surface, World
from vbaa_bench.spec.rigs import TrueRig, nominal_rig
from vbaa_bench.spec.scene import Scene
from vbaa_bench.spec.trials import random_generator

# Reflectance of the board's card and of the ink on it.
WHITE, BLACK = 0.7, 0.04


@dataclass(frozen=True)
class Studio:
    """Builds worlds of one scene's true rig in Sigma_a, where camera, lamp and background stand."""

    scene: Scene
    rig: TrueRig

    def bench(self, equilibrium: Equilibrium | None) -> World:
        """The beam pushed against its object, or at rest with no object near."""
        return World(self.rig.camera, self._lamp(), self._surfaces(equilibrium), self._unit())

    def repose(self, world: World, equilibrium: Equilibrium) -> None:
        """Bend the beam of a pushed bench anew and put the object where it belongs."""
        surfaces = self._surfaces(equilibrium)
        moving = {name: np.asarray(surfaces[name].mesh.vertices) for name in ("beam", "object")}
        world.move(moving, surfaces["beam"].arc_length)

    def card(self, view: int) -> World:
        """The calibration board alone: in plane C in view 0, tilted in the others."""
        antenna_from_board = self.rig.antenna_from_board @ self._tilt(view)
        white, black = board(nominal_rig(self.scene).board)
        for cells in (white, black):
            cells.vertices = apply(antenna_from_board, np.asarray(cells.vertices))
        surfaces = {"white": Surface(white, WHITE), "black": Surface(black, BLACK)}
        return World(self.rig.camera, self._lamp(), surfaces, self._unit())

    def _tilt(self, view: int) -> Floats:
        """Pose of a view's board against that of view 0: tilted about its own x and y axes."""
        if view == 0:
            return np.eye(4)
        random = random_generator(self.scene, "board view", view)
        most = self.scene.calibration.tilt_deg * DEGREE
        # Tilts spread evenly round the compass and away from flat, as a careful person holds it.
        share = (view + random.uniform(-0.2, 0.2)) / (self.scene.calibration.views - 1)
        compass = 2 * np.pi * share
        lean = most * random.uniform(0.7, 1.0)
        axis = np.array([np.cos(compass), np.sin(compass), 0.0])
        # Tilting brings one side nearer to the camera; lower the card so that it stays in view.
        away = random.uniform(0.12, 0.2) * self.scene.camera.position_mm[2] * MILLIMETRE
        return rigid(lean * axis, np.array([0.0, 0.0, -away]))

    def _surfaces(self, equilibrium: Equilibrium | None) -> dict[str, Surface]:
        scene, origin = self.scene, self.rig.base_position
        line = at_rest(self.rig.beam, scene.beam.pieces)
        if equilibrium is not None:
            line = equilibrium.centreline
        s, x, y, _ = line.T
        path = np.column_stack([x, y, np.zeros_like(x)]) + origin
        steel = tube(path, self.rig.beam.radius, scene.beam.facets)
        arc_length = arc_length_of_vertices(s, scene.beam.facets)
        surfaces = {"beam": Surface(steel, scene.beam.reflectance, "gloss", arc_length)}
        if equilibrium is not None:
            thing = scene.object
            touching = block(
                edge_of_object(equilibrium),
                equilibrium.pushing_angle - np.pi / 2,
                thing.side_mm * MILLIMETRE,
                thing.bottom_mm * MILLIMETRE,
                thing.top_mm * MILLIMETRE,
            )
            touching.apply_translation(origin)
            surfaces["object"] = Surface(touching, thing.reflectance)
        clamp = scene.hub
        motor = hub(
            clamp.radius_mm * MILLIMETRE,
            clamp.bottom_mm * MILLIMETRE,
            clamp.top_mm * MILLIMETRE,
        )
        motor.apply_translation(origin)
        surfaces["hub"] = Surface(motor, clamp.reflectance)
        surfaces["background"] = self._background()
        return surfaces

    def _background(self) -> Surface:
        """Far enough to the sides that the camera never sees its rim."""
        spec, length = self.scene.background, self.rig.beam.length
        middle = np.array([length / 2, 0.0, -spec.distance_mm * MILLIMETRE])
        return Surface(sheet(middle, 20 * length, 1), spec.reflectance)

    def _lamp(self) -> Lamp:
        spec, camera = self.scene.light, self.scene.camera.position_mm
        middle = np.array([camera[0], camera[1], spec.height_mm]) * MILLIMETRE
        return Lamp(sheet(middle, spec.side_mm * MILLIMETRE, -1))

    def _unit(self) -> RenderUnit:
        beam = self.rig.beam
        return RenderUnit(beam.radius, np.array([beam.length / 2, 0.0, 0.0]))


def edge_of_object(equilibrium: Equilibrium) -> Floats:
    """The touched edge (2,) [m] in the clamp's frame: R(dtheta) (x_0, -r)."""
    angle, x_0, r = (
        equilibrium.pushing_angle,
        equilibrium.contact_distance,
        equilibrium.beam.radius,
    )
    return np.array(
        [
            x_0 * np.cos(angle) + r * np.sin(angle),
            x_0 * np.sin(angle) - r * np.cos(angle),
        ]
    )
