"""Scene -> what will be made: every trial with its equilibrium, and nothing impossible."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply
from solver.instrument.units import MILLIMETRE
from vbaa_bench.mechanics.planar import Equilibrium, EquilibriumError, push
from vbaa_bench.spec.load import SceneFile
from vbaa_bench.spec.rigs import TrueRig, nominal_rig, true_rig
from vbaa_bench.spec.trials import Push, Trial, trials

# Thinner, and pixels' centres miss the beam for long stretches.
THINNEST_PX = 0.25


@dataclass(frozen=True)
class Plan:
    """The true rig, the trials in shards, and one equilibrium per distinct push."""

    rig: TrueRig
    shards: tuple[tuple[Trial, ...], ...]
    equilibria: dict[Push, Equilibrium]

    @property
    def frames(self) -> int:
        """How many there are in all shards."""
        return sum(len(shard) for shard in self.shards)


def plan(file: SceneFile) -> Plan:
    """Solve every push of a scene. Raises InputError listing all that cannot physically be."""
    scene = file.scene
    try:
        rig = true_rig(scene)
    except ValueError as error:
        raise InputError(file.complaint(("camera", "look_at_mm"), str(error))) from error
    made = trials(scene)
    equilibria: dict[Push, Equilibrium] = {}
    mistakes: list[str] = []
    for wanted in dict.fromkeys(trial.push for trial in made):
        try:
            equilibria[wanted] = _push(wanted, rig, scene.beam.pieces)
        except _ImpossibleError as error:
            wanted_mm = wanted.contact_distance / MILLIMETRE
            distances = np.array(scene.pushes.contact_distance_mm)
            index = int(np.argmin(np.abs(distances - wanted_mm)))
            key = ("pushes", "contact_distance_mm", index)
            mistakes.append(file.complaint(key, str(error)))
    mistakes += _overstressed(file, equilibria)
    mistakes += _inside_hub(file)
    mistakes += _board_out_of_view(file, rig)
    mistakes += _out_of_view(file, rig, equilibria.values())
    if mistakes:
        raise InputError("\n".join(dict.fromkeys(mistakes)))
    size = scene.frames_per_shard
    shards = tuple(tuple(made[i : i + size]) for i in range(0, len(made), size))
    return Plan(rig, shards, equilibria)


class _ImpossibleError(Exception):
    """A push that cannot be, said without its place in the file."""


def _push(wanted: Push, rig: TrueRig, pieces: int) -> Equilibrium:
    length = rig.beam.length
    if wanted.contact_distance >= length:
        raise _ImpossibleError(
            f"is {wanted.contact_distance / MILLIMETRE:g}, allowed is > 0 and before the tip "
            f"at {length / MILLIMETRE:g} mm"
        )
    try:
        return push(
            rig.beam,
            wanted.contact_distance,
            deflection=wanted.deflection,
            pushing_angle=wanted.pushing_angle,
            intervals=pieces,
        )
    except EquilibriumError as error:
        raise _ImpossibleError(
            f"is {wanted.contact_distance / MILLIMETRE:g}, which has no equilibrium when pushed to "
            f"{wanted}: {error}"
        ) from error


def _inside_hub(file: SceneFile) -> list[str]:
    hub = file.scene.hub.radius_mm
    return [
        file.complaint(
            ("pushes", "contact_distance_mm", index),
            f"is {distance:g}, allowed is beyond the hub's radius of {hub:g} mm",
        )
        for index, distance in enumerate(file.scene.pushes.contact_distance_mm)
        if distance <= hub
    ]


def _board_out_of_view(file: SceneFile, rig: TrueRig) -> list[str]:
    board = nominal_rig(file.scene).board
    # With the half of the outer squares that the corners' detection needs around them.
    corners = board.corners() * (1 + 1 / (min(board.columns, board.rows) - 1))
    if _in_view(rig.camera, apply(rig.antenna_from_board, corners)):
        return []
    return [file.complaint(("calibration",), "the camera does not see the whole board in view 0")]


def _in_view(camera: Camera, points: Floats) -> bool:
    """Whether points (n, 3) [m] in Sigma_a lie before the camera and in its image."""
    if apply(camera.camera_from_antenna, points)[:, 2].min() <= 0:
        return False
    u, v = camera.project(points).T
    return bool(
        u.min() >= -0.5
        and v.min() >= -0.5
        and u.max() <= camera.width - 0.5
        and v.max() <= camera.height - 0.5
    )


def _overstressed(file: SceneFile, equilibria: Mapping[Push, Equilibrium]) -> list[str]:
    beam = file.scene.beam
    if beam.allow_above_yield or not equilibria:
        return []
    modulus = beam.youngs_modulus_gpa * 1e9
    worst = max(equilibria, key=lambda push: equilibria[push].largest_stress(modulus))
    stress = equilibria[worst].largest_stress(modulus) / 1e6
    if stress <= beam.yield_stress_mpa:
        return []
    return [
        file.complaint(
            ("beam", "yield_stress_mpa"),
            f"is {beam.yield_stress_mpa:g}, but contact at "
            f"{worst.contact_distance / MILLIMETRE:g} mm pushed to {worst} stresses the beam to "
            f"{stress:.0f} MPa; push less, or set allow_above_yield: true",
        )
    ]


def _out_of_view(file: SceneFile, rig: TrueRig, equilibria: Iterable[Equilibrium]) -> list[str]:
    camera = rig.camera
    rest = np.array([[0.0, 0.0], [rig.beam.length, 0.0]])
    planar = np.vstack([rest, *(e.centreline[:, 1:3] for e in equilibria)])
    points = np.column_stack([planar, np.zeros(len(planar))]) + rig.base_position
    depth = apply(camera.camera_from_antenna, points)[:, 2]
    if depth.min() <= 0:
        return [file.complaint(("camera", "look_at_mm"), "lets the camera look away from the beam")]
    width_px = camera.fx * rig.beam.diameter / depth.max()
    if width_px < THINNEST_PX:
        return [
            file.complaint(
                ("camera",),
                f"sees the beam {width_px:.2g} px wide, allowed is >= {THINNEST_PX:g} px",
            )
        ]
    u, v = camera.project(points).T
    if _in_view(camera, points):
        return []
    return [
        file.complaint(
            ("camera",),
            f"does not see the whole beam: it spans u {u.min():.0f}..{u.max():.0f} px and "
            f"v {v.min():.0f}..{v.max():.0f} px, the image is {camera.width} x {camera.height} px",
        )
    ]
