"""The loaded beam of a frame before its camera, from the states that mechanics has solved."""

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.limits.image_shape import ImagedBeam
from vbaa_bench.limits.lit_beam import BeamPlaces
from vbaa_bench.mechanics.loaded import Load
from vbaa_bench.mechanics.state import State


def imaged_beam(pose: Pose, camera: Camera) -> ImagedBeam:
    """Return the beam of a frame under the loads of its contacts."""
    return _imaged(pose.experiment, pose.state, pose.motor_angle, camera)


def beam_at_rest(experiment: Experiment, camera: Camera) -> ImagedBeam:
    """Return the beam before contact, with the motor at angle zero."""
    return _imaged(experiment, experiment.rest, 0.0, camera)


def beam_places(imaged: ImagedBeam, state: State, fractions: Floats) -> BeamPlaces:
    """Return places on a beam at increasing `fractions` (n,) of its length."""
    line, s = state.centreline, fractions * state.centreline[-1, 0]
    directions = np.gradient(line[:, 1:], line[:, 0], axis=0)
    first = state.director
    if first is None:  # a round section: any axis across the tangent
        first = np.cross([0.0, 0.0, 1.0], directions)
    points, tangents, first = (
        _at(s, line[:, 0], rows) for rows in (line[:, 1:], directions, first)
    )
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    first -= np.einsum("ni,ni->n", first, tangents)[:, None] * tangents
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(tangents, first)], axis=1)
    turn, move = imaged.frame_from_clamp[:3, :3], imaged.frame_from_clamp[:3, 3]
    return BeamPlaces(s, points @ turn.T + move, tangents @ turn.T, axes @ turn.T)


def is_removed(pose: Pose, camera: Camera, pixels: Floats) -> Mask:
    """Test whether places (n, 2) [px] are in the stretch of x on plane C declared as missing."""
    cover, hidden = pose.spec.cover, pose.hidden
    if cover is None or hidden is None or cover.in_image:
        return np.zeros(len(pixels), np.bool_)
    ideal = camera.normalised(np.asarray(pixels, np.float64))
    x, _, w = camera.plane_from_normalised @ np.column_stack([ideal, np.ones(len(ideal))]).T
    start, end = hidden
    return np.asarray((start <= x / w) & (x / w <= end))


def _imaged(experiment: Experiment, state: State, motor_angle: float, camera: Camera) -> ImagedBeam:
    frame_from_clamp = experiment.camera_frame_from_clamp(motor_angle).copy()
    frame_from_clamp[:3, 3] += experiment.rig.base_position
    return ImagedBeam(
        rod=experiment.rod,
        loads=tuple(Load.of(state, i) for i in range(len(state.contacts))),
        camera=camera,
        frame_from_clamp=frame_from_clamp,
        turned=experiment.clamp_from_world(-state.pushing_angle)[:3, :3],
    )


def _at(s: Floats, places: Floats, rows: Floats) -> Floats:
    return np.column_stack([np.interp(s, places, column) for column in rows.T])
