"""Mechanics of one push of a scene: the rod, the motor and the obstacles."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert, rigid
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.assembly.clamp import overlaps_jaw
from vbaa_bench.assembly.mesh_file import SceneMeshes
from vbaa_bench.mechanics import linear, planar
from vbaa_bench.mechanics.contact import Obstacle
from vbaa_bench.mechanics.hung import hang
from vbaa_bench.mechanics.pushing import push, rest
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.mechanics.surfaces import Line, upright
from vbaa_bench.scene.laboratory import ClampSpec
from vbaa_bench.scene.objects.object import ObjectSetting
from vbaa_bench.scene.push import Push
from vbaa_bench.scene.rigs import TrueRig, nominal_rig, true_gravity
from vbaa_bench.scene.schema import Scene

LINEAR = "linear, eqs. (9) and (10)"
PLANAR = "exact, planar: round, weightless, frictionless"
SPATIAL = "exact, in space"
HUNG = "exact, under a hung weight"


@dataclass(frozen=True)
class Experiment:
    """A push of a scene with its true rig. `folder` contains the files that the scene names."""

    scene: Scene
    rig: TrueRig
    push: Push
    folder: Path

    @classmethod
    def at_rest(cls, scene: Scene, rig: TrueRig, folder: Path) -> "Experiment":
        """Return the experiment before any push, with the motor at angle zero."""
        push = Push(0.5 * rig.beam.length, 0.0, 0.0, (), true_gravity(scene))
        return cls(scene, rig, push, folder)

    @cached_property
    def rod(self) -> Rod:
        """The beam with the scene's section, taper, weight, bow and extensibility."""
        spec, beam = self.scene.beam, self.rig.beam
        section = spec.section_shape
        area = 4 * section.fill * beam.radius**2 * spec.aspect_ratio
        linear_density = spec.density_kg_m3 * area
        x, y, z = self.push.gravity
        return Rod(
            beam,
            shape=section.rod_shape,
            aspect_ratio=spec.aspect_ratio,
            section_angle=spec.section_angle_deg * DEGREE,
            tip_ratio=spec.tip_ratio,
            weight=(linear_density * x, linear_density * y, linear_density * z),
            bow=(8 * spec.bow_mm * MILLIMETRE / beam.length**2, 0.0),
            extensible=spec.extensible,
            clamp_softness=spec.clamp_softness,
        )

    @cached_property
    def motor(self) -> Motor:
        """The motor shaft; the clamp may be offset from its axis."""
        x, y, z = (-v * MILLIMETRE for v in self.scene.clamp_offset_mm)
        return Motor(point=(x - self.rig.grip, y, z))

    @cached_property
    def object_setting(self) -> ObjectSetting:
        """What the shape of the touched object refers to, in its frame."""
        # If the beam sags, the object's frame moves with it; the ground does not.
        point, _ = self._resting_at(self.push.contact_distance or 0.0)
        ground = self.ground - float(point[2])
        return ObjectSetting(self.rig.beam.radius, ground, SceneMeshes(self.folder))

    @property
    def ground(self) -> float:
        """Height [m] of the background."""
        return self.scene.background.height

    @cached_property
    def rest(self) -> State:
        """The beam before contact."""
        return rest(self.rod, self.scene.beam.centreline_segments)

    @property
    def youngs_modulus(self) -> float:
        """The true Young's modulus [Pa], in proportion to the beam's true flexural rigidity."""
        nominal = nominal_rig(self.scene).beam.flexural_rigidity
        true = self.rig.beam.flexural_rigidity
        return self.scene.beam.youngs_modulus_gpa * 1e9 * true / nominal

    @cached_property
    def obstacles(self) -> list[Obstacle]:
        """The object in its position, and the second peg if there is one."""
        obstacles = [self._obstacle()]
        peg = self.scene.second_peg
        if peg is not None:
            point, tangent = self._resting_at(peg.distance_mm * MILLIMETRE)
            gap = (peg.gap_mm * MILLIMETRE) * np.array([0.0, 1.0, 0.0])
            offset = self.rod.reach(peg.distance_mm * MILLIMETRE, np.pi)
            # The peg is on the other side of the beam, so the tangent is reversed.
            pose = _placed(point + gap, -tangent, 0.0, offset)
            obstacles.append(Obstacle(upright(peg.radius_mm * MILLIMETRE), pose))
        return obstacles

    @property
    def model(self) -> str:
        """Name of the mechanical model that solves this push."""
        if self.scene.mechanics == "linear":
            return LINEAR
        if self.scene.object.mass() is not None:
            return HUNG
        scene, first = self.scene, self.obstacles[0]
        upright_edge = isinstance(first.surface, Line) and self.push.normal == 0
        drifts = any(scene.object.drift())
        beside = any(scene.clamp_offset_mm) or self.rig.grip
        simple = not (first.friction or drifts or scene.second_peg or beside)
        return PLANAR if self.rod.plain and upright_edge and simple else SPATIAL

    def states(self) -> list[State]:
        """Solve the equilibria of the push, one per step.

        Raises EquilibriumError, and InputError for an object that is impossible or cannot deform
        that far.
        """
        states = self._states()
        if self.model == HUNG:
            return states
        shifts = [float(np.linalg.norm(s.contact.object_shift)) for s in states if s.contacts]
        if self.scene.object.deforms:  # check size and give
            self.scene.object.mesh(self.object_setting, max(shifts, default=0.0))
        if self.scene.object.present:
            self._check_hub()
            if self.scene.clamp is not None:
                self._check_jaw(self.scene.clamp, states)
        for step, state in enumerate(states):
            for contact in state.contacts[:1]:
                object_from_clamp = invert(self.clamp_from_object(state, step))
                point = apply(object_from_clamp, (contact.point + contact.lever)[None])[0]
                tangent = object_from_clamp[:3, :3] @ contact.tangent
                reason = self.scene.object.misses(self.object_setting, point, tangent)
                if reason is not None:
                    raise EquilibriumError(f"at {self.push.targets[step]} {reason}")
        return states

    def _check_hub(self) -> None:
        """Raise EquilibriumError if the object overlaps the hub about the motor's axis."""
        first, clamp = self.obstacles[0], self.scene.clamp
        flange = 0.0 if clamp is None else clamp.flange_radius_mm
        radius_mm, part = max((self.scene.hub.radius_mm, "hub"), (flange, "flange"))
        hub = radius_mm * MILLIMETRE
        axis = apply(invert(first.world_from_object), np.array([self.motor.point]))[0]
        clearance, _ = first.surface.distance(axis)
        # The distance to a sharp edge does not account for the object's width behind it.
        edge = isinstance(first.surface, Line) and first.surface.radius == 0
        if (abs(clearance) if edge else clearance) < hub:
            raise EquilibriumError(
                f"the object is {clearance / MILLIMETRE:.4g} mm from the motor's axis, "
                f"allowed is beyond the {part}'s radius of {radius_mm:g} mm"
            )

    def _check_jaw(self, clamp: ClampSpec, states: Sequence[State]) -> None:
        """Raise EquilibriumError if the object overlaps the clamp's jaw in a step."""
        for step, state in enumerate(states):
            if overlaps_jaw(clamp, np.asarray(self.touched_mesh(state, step).vertices)):
                raise EquilibriumError(
                    f"at {self.push.targets[step]} the object overlaps the clamp's jaw, allowed is "
                    "a narrower jaw or an object farther away"
                )

    def _states(self) -> list[State]:
        model, segments = self.model, self.scene.beam.centreline_segments
        if (mass := self.scene.object.mass()) is not None:
            force = mass * np.array(self.push.gravity)
            angles, place = [step.size for step in self.steps], self.push.contact_distance or 0.0
            return hang(self.rod, self.motor, place, force, angles, segments)
        distance, first = self.push.contact_distance or 0.0, self.obstacles[0]
        if model == SPATIAL:
            return push(self.rod, self.motor, self.obstacles, distance, self.steps, segments)
        if model == LINEAR:
            solve = partial(linear.push, normal_angle=self.push.normal)
        else:
            assert isinstance(first.surface, Line)
            solve = partial(planar.push, object_radius=first.surface.radius)
        states = []
        for step in self.steps:
            if step.size <= 0:
                states += push(self.rod, self.motor, [first], distance, [step], segments)
            else:
                states.append(
                    solve(
                        self.rig.beam,
                        distance,
                        deflection=step.deflection,
                        pushing_angle=step.pushing_angle,
                        compliance=first.compliance,
                        intervals=segments,
                    )
                )
        return states

    @cached_property
    def steps(self) -> list[Step]:
        """The targets of the push, with the object's drift at each."""
        x, y, z = self.scene.object.drift()
        return [
            Step(target.pushing_angle, target.deflection, (i * x, i * y, i * z))
            for i, target in enumerate(self.push.targets)
        ]

    def clamp_from_object(self, state: State, step: int, index: int = 0) -> Floats:
        """Compute clamp_from_object (4, 4) of an obstacle, displaced as the beam has pushed it."""
        if self.model == HUNG:
            return _hanging(state.contact.point, state.contact.tangent, state.contact.force)
        obstacle = self.obstacles[index]
        world = self.motor.clamp_from_world(state.pushing_angle, self.steps[step].drift)
        pose = world @ obstacle.world_from_object
        for contact in state.contacts:
            if contact.obstacle != index:
                continue
            if self.scene.mechanics == "linear":
                # Use the contact of linear theory, which a rigid rotation does not reproduce.
                across = contact.normal - (contact.normal @ contact.tangent) * contact.tangent
                across *= self.rig.beam.radius / np.linalg.norm(across)
                pose[:3, 3] = contact.point - across
            else:
                pose[:3, 3] += contact.object_shift
        return pose

    def touched_mesh(self, state: State, step: int) -> trimesh.Trimesh:
        """Build the object's mesh as deformed by the beam, in the clamp's frame [m]."""
        pose = self.clamp_from_object(state, step)
        give, slope = 0.0, 0.0
        if state.contacts:
            give = float(np.linalg.norm(state.contact.object_shift))
            along, up, _ = pose[:3, :3].T @ state.contact.tangent
            slope = float(up / along)
        mesh = self.scene.object.mesh(self.object_setting, give, slope)
        mesh.vertices = apply(pose, np.asarray(mesh.vertices))
        return mesh

    def table_from_antenna(self, onset: float) -> Floats:
        """Compute the pose (4, 4) of Sigma_a at motor angle zero on the object's table.

        `onset` [rad] is the motor angle at first contact. The object is where it is first touched.
        """
        # Mechanics has its world in the clamp at first contact; see `camera_frame_from_clamp`.
        antenna_from_world = invert(self.clamp_from_world(onset))
        antenna_from_world[:3, 3] += self.rig.base_position
        antenna_from_object = antenna_from_world @ self.obstacles[0].world_from_object
        object_from_table = self.scene.object.object_from_table(self.object_setting)
        return invert(antenna_from_object @ object_from_table)

    def clamp_from_world(self, motor_angle: float) -> Floats:
        """Compute clamp_from_world (4, 4) at a motor angle [rad]."""
        return self.motor.clamp_from_world(-motor_angle, (0.0, 0.0, 0.0))

    def camera_frame_from_clamp(self, motor_angle: float) -> Floats:
        """Compute camera_frame_from_clamp (4, 4) at a motor angle [rad].

        The camera is fixed in this frame: the clamp's or the world's, depending on its mount.
        """
        if self.scene.camera.mount == "antenna":
            return np.eye(4)
        return invert(self.clamp_from_world(motor_angle))

    def _obstacle(self) -> Obstacle:
        spec = self.scene.object
        if (gap := spec.gap()) is not None:
            point = np.array([self.rig.beam.length / 2, -gap, 0.0])
            tangent = np.array([1.0, 0.0, 0.0])
        else:
            point, tangent = self._resting_at(self.push.contact_distance or 0.0)
        offset = self.rod.reach(self.push.contact_distance or 0.0, self.push.normal)
        pose = _placed(point, tangent, self.push.normal, offset)
        return Obstacle(
            spec.surface(self.object_setting),
            pose,
            compliance=self.push.compliance,
            spring=pose[:3, 1],
            friction=spec.friction_coefficient(),
        )

    def _resting_at(self, s: float) -> tuple[Floats, Floats]:
        """Interpolate point and tangent (3,) of the beam at rest at arc length `s` [m]."""
        line = self.rest.centreline
        point = np.array([np.interp(s, line[:, 0], line[:, i]) for i in (1, 2, 3)])
        i = int(np.clip(np.searchsorted(line[:, 0], s), 1, len(line) - 1))
        step = line[i, 1:] - line[i - 1, 1:]
        return point, step / np.linalg.norm(step)


def _placed(at: Floats, tangent: Floats, tilt: float, reach: float) -> Floats:
    """Compute world_from_object (4, 4) of an object that touches the beam at rest.

    The beam's centreline passes through `at` (3,) [m] along `tangent` (3,). The object's edge, its
    z axis, is tilted by `tilt` [rad] from upright; its outward normal is perpendicular to both. The
    beam's surface is `reach` [m] from the centreline.
    """
    edge = np.array([0.0, -np.sin(tilt), np.cos(tilt)])
    outward = np.cross(edge, tangent)
    outward /= np.linalg.norm(outward)
    pose = rigid(np.zeros(3), at - reach * outward)
    pose[:3, :3] = np.column_stack([np.cross(outward, edge), outward, edge])
    return pose


def _hanging(at: Floats, tangent: Floats, force: Floats) -> Floats:
    """Compute clamp_from_object (4, 4) of a weight that pulls at `at` (3,) [m] with `force` (3,).

    Its y axis is up; its x axis is the beam's `tangent` (3,), made level.
    """
    up = -force / np.linalg.norm(force)
    level = tangent - (tangent @ up) * up
    level /= np.linalg.norm(level)
    pose = rigid(np.zeros(3), at)
    pose[:3, :3] = np.column_stack([level, up, np.cross(level, up)])
    return pose
