"""Impossibilities of a scene: stress, view, lamps, ground, and files that cannot be read."""

import itertools
from collections.abc import Collection

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.ground import ground_setting
from vbaa_bench.assembly.mesh_file import check_mesh
from vbaa_bench.dataset.scene_files import read_file
from vbaa_bench.geometry.sheets import between
from vbaa_bench.mechanics.state import State
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.image_files import read_environment, read_surface_image
from vbaa_bench.scene.files import SceneFileError
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.part import KeyPath
from vbaa_bench.scene.push import Push
from vbaa_bench.scene.rigs import TrueRig, nominal_rig

# Minimum width [px] of the beam. Below it, pixel centres miss the beam over long stretches.
MIN_WIDTH_PX = 0.25
# The axes, and the diagonals between them.
_DIRECTIONS = np.array([d for d in itertools.product((-1, 0, 1), repeat=3) if any(d)], dtype=float)


def check_files(file: SceneFile) -> None:
    """Read every file that a scene names or may draw. Raises SceneFileError, with its key."""
    for key, name, kind in file.named_files:
        try:
            if kind == "mesh":
                check_mesh(read_file(file.folder, name, kind))
            elif kind == "image":
                read_surface_image(file.folder, name)
            else:
                read_environment(file.folder, name)
        except SceneFileError as error:
            raise SceneFileError(file.message_at(key, str(error))) from error


class Extremes:
    """Extremes over all states: the largest stress, and the outermost points."""

    def __init__(self, file: SceneFile, rig: TrueRig) -> None:
        self._file, self._rig = file, rig
        self._stress, self._stressed, self._lowest = 0.0, "", 0.0
        rest = np.array([[0.0, 0.0, 0.0], [rig.beam.length, 0.0, 0.0]]) + rig.base_position
        self._points = rest

    def add(self, experiment: Experiment, states: list[State], onsets: Collection[float]) -> None:
        """Add the states of one push, with its motor angles [rad] at first contact, `onsets`."""
        push = experiment.push
        for target, state in zip(push.targets, states, strict=True):
            stress = state.largest_strain * experiment.youngs_modulus / 1e6
            if stress > self._stress:
                self._stress, self._stressed = stress, f"{_location(push)}to {target}"
            self._lowest = min(self._lowest, float(state.centreline[:, 3].min()))
            for onset in onsets:
                frame_from_clamp = experiment.camera_frame_from_clamp(onset - state.pushing_angle)
                points = apply(frame_from_clamp, state.centreline[:, 1:]) + self._rig.base_position
                points = np.vstack([self._points, points])
                # Keep only the outermost points along every axis and diagonal.
                extents = points @ _DIRECTIONS.T
                outermost = np.unique(np.concatenate([extents.argmin(0), extents.argmax(0)]))
                self._points = points[outermost]

    def mistakes(self) -> list[str]:
        """List complaints about stress, ground, view and lamps."""
        return (
            self._overstressed() + self._below_ground() + self._out_of_view() + self._behind_lamps()
        )

    def _below_ground(self) -> list[str]:
        scene, depth = self._file.scene, (self._rig.beam.radius - self._lowest) / MILLIMETRE
        ground, clutter = scene.background.distance_mm, scene.clutter
        reaches = f"but the beam reaches {depth:.4g} mm below plane C"
        if depth > ground:
            return [
                self._file.message_at(("background", "distance_mm"), f"is {ground:g}, {reaches}")
            ]
        top = 0.0 if clutter is None else clutter.highest_mm(-ground)
        if clutter is not None and clutter.under_beam and depth > -top:
            return [self._file.message_at(("clutter", "top_mm"), f"is {top:g}, {reaches}")]
        wires = scene.wires
        if wires is not None and depth > -wires.highest_mm:
            message = f"ends at {wires.height_mm[1]:g}, {reaches}"
            return [self._file.message_at(("wires", "height_mm"), message)]
        return []

    def _overstressed(self) -> list[str]:
        beam = self._file.scene.beam
        if beam.allow_above_yield or self._stress <= beam.yield_stress_mpa:
            return []
        return [
            self._file.message_at(
                ("beam", "yield_stress_mpa"),
                f"is {beam.yield_stress_mpa:g}, but {self._stressed} stresses the beam to "
                f"{self._stress:.0f} MPa; push less, or set allow_above_yield: true",
            )
        ]

    def _out_of_view(self) -> list[str]:
        camera, points, file = self._rig.camera, self._points, self._file
        depth = apply(camera.camera_from_antenna, points)[:, 2]
        if depth.min() <= 0:
            message = "points the camera away from the beam"
            return [file.message_at(("camera", "look_at_mm"), message)]
        width_px = float(camera.pixels_per_metre(points).min()) * self._rig.beam.diameter
        if width_px < MIN_WIDTH_PX:
            message = f"sees the beam {width_px:.2g} px wide, allowed is >= {MIN_WIDTH_PX:g} px"
            return [file.message_at(("camera",), message)]
        u, v = camera.project(points).T
        if not file.scene.camera.tip_in_view or _in_view(camera, points):
            return []
        return [
            file.message_at(
                ("camera",),
                f"does not see the whole beam: it spans u {u.min():.0f}..{u.max():.0f} px and "
                f"v {v.min():.0f}..{v.max():.0f} px, "
                f"the image is {camera.width} x {camera.height} px",
            )
        ]

    def _behind_lamps(self) -> list[str]:
        """List the lamps that hide the beam, or the board in view 0, from the camera."""
        file, rig, pose = self._file, self._rig, self._rig.camera.camera_from_antenna
        board = apply(rig.antenna_from_board, nominal_rig(file.scene).board.corners())
        fraction = np.linspace(0, 1, 65)[:, None]
        at_rest = rig.base_position + fraction * [rig.beam.length, 0.0, 0.0]
        ends = np.vstack([self._points, at_rest, board])
        starts = np.broadcast_to(invert(pose)[:3, 3], ends.shape)
        if rig.camera.telecentric:
            depth = apply(pose, ends)[:, 2:]
            starts = ends - depth * pose[2, :3]
        lamps = lights(file.scene, file.folder) if file.scene.lights else []
        return [
            file.message_at(
                ("lights", number),
                "is between the camera and the beam or the board, allowed is out of its view",
            )
            for number, light in enumerate(lamps)
            if light.sheet is not None and between(light.sheet.mesh, starts, ends).any()
        ]


def _location(push: Push) -> str:
    if push.contact_distance is None:
        return "contact pushed "
    return f"contact at {push.contact_distance / MILLIMETRE:g} mm pushed "


def too_far_or_near(file: SceneFile, rig: TrueRig) -> list[str]:
    """List the contact distances within the hub or beyond the tip."""
    scene = file.scene
    hub, length = scene.hub.radius_mm, rig.beam.length / MILLIMETRE
    if scene.sampling is not None:
        key: KeyPath = ("sampling", "contact_distance_mm")
        distances = enumerate(scene.sampling.contact_distance_mm)
    else:
        key = ("pushes", "contact_distance_mm")
        pushes = scene.pushes
        distances = enumerate(pushes.contact_distance_mm or () if pushes else ())
    mistakes = []
    for index, distance in distances:
        if distance <= hub:
            mistakes.append(f"is {distance:g}, allowed is beyond the hub's radius of {hub:g} mm")
        elif distance >= length:
            mistakes.append(f"is {distance:g}, allowed is before the tip at {length:g} mm")
        else:
            continue
        mistakes[-1] = file.message_at((*key, index), mistakes[-1])
    peg = scene.second_peg
    if peg is not None and not hub < peg.distance_mm < length:
        message = f"is {peg.distance_mm:g}, allowed is between the hub's radius of {hub:g} mm"
        peg_key = ("second_peg", "distance_mm")
        mistakes.append(file.message_at(peg_key, f"{message} and the tip at {length:g} mm"))
    return mistakes


def too_fine(file: SceneFile, rig: TrueRig) -> list[str]:
    """List a ground whose pattern the camera does not resolve."""
    mistake = file.scene.background.kind.mistake(ground_setting(file.scene, rig))
    if mistake is None:
        return []
    return [file.message_at(("background", mistake.key), mistake.sentence)]


def board_out_of_view(file: SceneFile, rig: TrueRig) -> list[str]:
    """List a board that is not wholly in the image in view 0."""
    board = nominal_rig(file.scene).board
    # Include half of the outer squares, which corner detection needs.
    corners = board.corners() * (1 + 1 / (min(board.columns, board.rows) - 1))
    if _in_view(rig.camera, apply(rig.antenna_from_board, corners)):
        return []
    return [file.message_at(("calibration",), "the camera does not see the whole board in view 0")]


def _in_view(camera: Camera, points: Floats) -> bool:
    """Test whether points (n, 3) [m] in Sigma_a are in front of the camera and in its image."""
    if apply(camera.camera_from_antenna, points)[:, 2].min() <= 0:
        return False
    u, v = camera.project(points).T
    return bool(
        u.min() >= -0.5
        and v.min() >= -0.5
        and u.max() <= camera.width - 0.5
        and v.max() <= camera.height - 0.5
    )
