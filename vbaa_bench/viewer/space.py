"""Entities in space: camera, board, beam, bodies, contact and force, in mm."""

from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, invert
from solver.instrument.units import MILLIMETRE
from vbaa_bench.report import palette
from vbaa_bench.viewer.bodies import Bodies
from vbaa_bench.viewer.ellipses import estimated_contact
from vbaa_bench.viewer.frames import ViewedDataset, ViewedFrame
from vbaa_bench.viewer.log import Log, present, rgb

# Colours, chosen: muted for bodies, so that beam and estimates stand out.
_BODIES: Final = {"object": "#3f6fb5", "second_peg": "#3f6fb5", "occluder": "#4f8a4f"}
_OTHER_BODY: Final = "#6b7078"
_BOARD: Final = "#4a4f57"
_FORCE: Final = "#ffe814"
_AXES: Final = ("#d05050", "#50b050", "#5080d0")
# Lengths of the axes and of the arrow of a force over that of the beam, and of the camera's pyramid
# over its distance. Chosen: all are in view with the whole beam.
_AXIS, _ARROW, _PYRAMID = 0.08, 0.15, 0.6


class Space:
    """Writer of the entities in space, in the frame in which the camera is fixed.

    This frame is Sigma_a, or Sigma_o if the camera does not turn with the motor.
    """

    def __init__(self, log: Log, data: ViewedDataset, bodies: Bodies) -> None:
        self._log, self._data, self._bodies = log, data, bodies
        self._rig = data.truth.manifest["true_rig"]
        self._length = self._rig["beam_length_mm"]
        self._radius = self._rig["beam_diameter_mm"] / 2
        self._meshes: dict[str, Floats] = {}

    def fixed(self) -> None:
        """Write what does not move: axes, camera and board."""
        log, rr = self._log, self._log.rr
        log.write("space", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        colours = [rgb(colour) for colour in _AXES]
        arrows = rr.Arrows3D(vectors=_AXIS * self._length * np.eye(3), colors=colours)
        log.write("space/3d/axes", arrows, static=True)
        log.lines("space/3d/board", self._bodies.board_lines(), _BOARD, 0.5, static=True)
        camera = self._data.truth.camera
        if camera.telecentric:
            log.lines("space/3d/field", [_field(self._data)], palette.POINTS, static=True)
            return
        pose = invert(camera.camera_from_antenna)
        position = pose[:3, 3] / MILLIMETRE
        pinhole = rr.Pinhole(
            focal_length=(camera.fx, camera.fy),
            # The centre of the first pixel is (0, 0) in OpenCV and (1/2, 1/2) in rerun.
            principal_point=(camera.cx + 0.5, camera.cy + 0.5),
            resolution=(camera.width, camera.height),
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=_PYRAMID * float(np.linalg.norm(position)),
        )
        transform = rr.Transform3D(translation=position, mat3x3=pose[:3, :3])
        log.write("space/camera", pinhole, transform, static=True)

    def frame(self, frame: ViewedFrame, colours: dict[str, str]) -> None:
        """Write beam, bodies, force, and true and estimated contacts of a frame."""
        log, rr, row = self._log, self._log.rr, frame.row
        transform = frame.frame_from_clamp
        line = np.column_stack([row[f"centreline_{axis}_mm"] for axis in "xyz"]) * MILLIMETRE
        beam = apply(transform, line) / MILLIMETRE
        strip = rr.LineStrips3D([beam], colors=rgb(palette.TRUTH), radii=self._radius)
        log.write("space/3d/beam", strip)
        touches = row["contact_row"] is not None
        contact = beam[row["contact_row"]] if touches else None
        log.points("space/3d/contact", present(contact), palette.TRUTH, 4.0, "true contact")
        arrows = np.zeros((0, 3))
        if contact is not None:
            direction = transform[:3, :3] @ np.array(row["force_antenna_n"]) / row["force_n"]
            arrows = _ARROW * self._length * direction[None]
        origins = np.zeros((0, 3)) if contact is None else contact - arrows
        force = rr.Arrows3D(
            origins=origins, vectors=arrows, colors=rgb(_FORCE), radii=rr.Radius.ui_points(1.5)
        )
        log.write("space/3d/force", force)
        for method, colour in colours.items():
            estimate = estimated_contact(frame, method)
            point = None if estimate is None else estimate.point / MILLIMETRE
            outline = None if estimate is None else estimate.ellipse
            strips = [] if outline is None else [outline / MILLIMETRE]
            log.points(f"space/3d/estimates/{method}", present(point), colour, 3.0, method)
            log.lines(f"space/3d/estimates/{method}/ellipse", strips, colour)
        self._show_bodies(row["trial"])

    def _show_bodies(self, trial: int) -> None:
        """Write the meshes of bodies that have moved since the last frame."""
        rr = self._log.rr
        for name, mesh in self._bodies.of_frame(trial):
            vertices = np.asarray(mesh.vertices) / MILLIMETRE
            if name in self._meshes and np.array_equal(vertices, self._meshes[name]):
                continue
            self._meshes[name] = vertices
            # Each face has its own corners, so that edges are sharp.
            faces = rr.Mesh3D(
                vertex_positions=vertices[np.asarray(mesh.faces)].reshape(-1, 3),
                vertex_normals=np.repeat(np.asarray(mesh.face_normals), 3, axis=0),
                albedo_factor=rgb(_BODIES.get(name, _OTHER_BODY)),
            )
            self._log.write(f"space/3d/bodies/{name}", faces)


def _field(data: ViewedDataset) -> Floats:
    """Compute the rim (5, 3) [mm] of a telecentric camera's field in plane C."""
    camera = data.truth.camera
    u, v = camera.width - 0.5, camera.height - 0.5
    corners = np.array([(-0.5, -0.5), (u, -0.5), (u, v), (-0.5, v), (-0.5, -0.5)])
    return camera.on_plane(corners) / MILLIMETRE
