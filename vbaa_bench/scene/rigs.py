"""The nominal rig, as in the datasheet, and the true rig."""

import math
from dataclasses import dataclass, replace

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.beam_shape import stated_shape
from solver.instrument.camera import Camera
from solver.instrument.rig import ClampOffset, Gravity, Light, Rig, Sensors, Tolerances
from solver.instrument.transforms import camera_looking_at, rigid
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.scene.light_direction import light_across, light_direction
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.schema import Scene


@dataclass(frozen=True)
class TrueRig:
    """True rig, hidden from solvers: beam, clamp and hub position (3,) [m], camera, board pose.

    The clamp grips the beam deeper by `grip` [m] than planned, and is as much farther from the
    motor's axis.
    """

    beam: Beam
    base_position: Floats
    camera: Camera
    antenna_from_board: Floats
    grip: float = 0.0

    def knocked(self, scene: Scene) -> "TrueRig":
        """Return the rig of the frames, whose camera may have been knocked."""
        right, down = scene.camera.knock_px
        camera = replace(self.camera, cx=self.camera.cx + right, cy=self.camera.cy + down)
        return replace(self, camera=camera)


def nominal_rig(scene: Scene) -> Rig:
    """Return the nominal rig of a scene, with its tolerances."""
    beam, tolerances, target = scene.beam, scene.tolerances, scene.calibration
    moment, force = scene.moment_sensor, scene.force_sensor
    diameter, modulus = beam.diameter_mm * MILLIMETRE, beam.youngs_modulus_gpa * 1e9
    section, light = beam.section_shape, light_direction(scene)
    rigidity = section.rigidity(modulus, diameter, beam.aspect_ratio)
    sag = _sag(scene, rigidity)
    return Rig(
        beam=Beam(beam.length_mm * MILLIMETRE, diameter, rigidity),
        base_position=np.zeros(3),
        board=target.board,
        antenna_from_board=rigid(np.zeros(3), np.array([*target.center_mm, 0.0]) * MILLIMETRE),
        deflects_towards=_deflects_towards(scene),
        tolerances=Tolerances(
            beam_length=tolerances.beam_length_mm * MILLIMETRE,
            flexural_rigidity=tolerances.flexural_rigidity_pct * PERCENT * rigidity,
            base_position=tolerances.base_mm * MILLIMETRE,
            board_translation=tolerances.board_mm * MILLIMETRE,
            board_rotation=tolerances.board_deg * DEGREE,
            encoder=tolerances.encoder_deg * DEGREE,
            camera_shift_px=tolerances.camera_shift_px,
            tip=tolerances.tip_mm * MILLIMETRE,
        ),
        telecentric=scene.camera.is_telecentric,
        camera_mount=scene.camera.mount,
        known_psi=beam.section_angle_deg * DEGREE if section.is_flat else None,
        sensors=Sensors(
            moment_y=None if moment is None else moment.sigma_n_mm * MILLIMETRE,
            base_force=None if force is None else force.force_sigma_n,
            base_moment=None if force is None else force.moment_sigma_n_mm * MILLIMETRE,
        ),
        distortion_coefficients=len(scene.camera.distortion),
        sag=-float(sag[2]),
        sag_in_plane=sag[:2],
        light=Light(
            slope=light.slope,
            slope_sigma=light.sigma,
            distance=light.distance_mm * MILLIMETRE,
            across=light_across(scene),
        ),
        shape=stated_shape(
            taper=tolerances.tip_ratio_pct * PERCENT,
            softness=tolerances.clamp_softness,
            section=tolerances.aspect_ratio_pct * PERCENT,
            friction=tolerances.friction,
            clamp_shift=tolerances.grip_mm / beam.length_mm,
            rigid_objects=tolerances.rigid_objects,
            bow_sigma=math.inf if tolerances.bow_mm is None else tolerances.bow_mm / beam.length_mm,
        ),
        gravity=_stated_gravity(scene),
        clamp_offset=ClampOffset(
            covariance=np.eye(2) * (tolerances.clamp_offset_mm * MILLIMETRE) ** 2
        ),
    )


def _stated_gravity(scene: Scene) -> Gravity | None:
    """Return the direction of gravity in plane C that a hung weight needs."""
    if scene.object.mass() is None:
        return None
    x, y, _ = scene.gravity_m_s2
    return Gravity(math.atan2(y, x), scene.tolerances.gravity_deg * DEGREE)


def _deflects_towards(scene: Scene) -> int:
    """Return the side of Sigma_a's y axis to which contact bends the beam, as 1 or -1."""
    hangs_back = scene.object.mass() is not None and scene.gravity_m_s2[1] < 0
    return -1 if hangs_back else 1


def true_gravity(scene: Scene) -> tuple[float, float, float]:
    """Return the true gravity [m/s^2] in Sigma_o: the stated one, or turned by its tolerance."""
    x, y, z = scene.gravity_m_s2
    if scene.tolerances.true_rig == "nominal" or not scene.tolerances.gravity_deg:
        return (x, y, z)
    angle = scene.tolerances.gravity_deg * DEGREE
    angle *= float(random_generator(scene, "true gravity").standard_normal())
    cos, sin = math.cos(angle), math.sin(angle)
    return (cos * x - sin * y, sin * x + cos * y, z)


def _sag(scene: Scene, rigidity: float) -> Floats:
    """Compute the tip's sag (3,) [m] under the nominal weight, were it across, by linear theory."""
    beam, diameter = scene.beam, scene.beam.diameter_mm * MILLIMETRE
    area = diameter**2 * beam.aspect_ratio * beam.section_shape.fill
    weight = np.array(scene.gravity_m_s2) * beam.density_kg_m3 * area
    return np.asarray(weight * (beam.length_mm * MILLIMETRE) ** 4 / (8 * rigidity))


def true_rig(scene: Scene) -> TrueRig:
    """Return the true rig: nominal values, or values drawn with the tolerances as sigmas."""
    rig, spec = nominal_rig(scene), scene.camera
    scale = spec.focal_length_px
    if spec.magnification_px_per_mm is not None:
        scale = spec.magnification_px_per_mm / MILLIMETRE
    camera = Camera(
        width=spec.width_px,
        height=spec.height_px,
        fx=scale,
        fy=scale,
        cx=(spec.width_px - 1) / 2 + spec.principal_point_offset_px[0],
        cy=(spec.height_px - 1) / 2 + spec.principal_point_offset_px[1],
        camera_from_antenna=camera_looking_at(
            np.array(spec.position_mm) * MILLIMETRE,
            np.array(spec.look_at_mm) * MILLIMETRE,
            spec.roll_deg * DEGREE,
        ),
        telecentric=spec.is_telecentric,
        distortion=spec.distortion,
    )
    if scene.tolerances.true_rig == "nominal":
        return TrueRig(rig.beam, rig.base_position, camera, rig.antenna_from_board)
    draw = random_generator(scene, "true rig").standard_normal
    sigma = rig.tolerances
    beam = Beam(
        rig.beam.length + sigma.beam_length * draw(),
        rig.beam.diameter,
        rig.beam.flexural_rigidity + sigma.flexural_rigidity * draw(),
    )
    board_error = rigid(sigma.board_rotation * draw(3), sigma.board_translation * draw(3))
    board = rig.antenna_from_board.copy()
    board[:3, 3] += board_error[:3, 3]
    board[:3, :3] = board_error[:3, :3] @ board[:3, :3]
    base = rig.base_position + sigma.base_position * draw(3)
    # The last draw: rigs without this tolerance are as before.
    grip = scene.tolerances.grip_mm * MILLIMETRE * float(draw())
    shorter = replace(beam, length=beam.length - grip)
    return TrueRig(shorter, base + np.array([grip, 0.0, 0.0]), camera, board, grip)
