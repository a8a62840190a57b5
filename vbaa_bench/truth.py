"""What the truth says of a frame, and of the rig: lengths in mm, angles in degrees."""

from typing import Any

import numpy as np

from solver.instrument.transforms import apply, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE, PERCENT
from vbaa_bench.mechanics.planar import Equilibrium
from vbaa_bench.spec.rigs import TrueRig
from vbaa_bench.spec.scene import Scene
from vbaa_bench.spec.trials import Trial


def motor_angle(scene: Scene, e: Equilibrium) -> float:
    """True motor angle [rad]: seen from the camera it turns clockwise, bending the beam to +y."""
    return scene.pushes.motor_angle_at_contact_deg * DEGREE - e.pushing_angle


def truth_row(scene: Scene, rig: TrueRig, trial: Trial, e: Equilibrium) -> dict[str, Any]:
    """The truth of one frame, as a row of `truth.parquet`."""
    mm, phi = MILLIMETRE, motor_angle(scene, e)
    base = rig.base_position
    contact_d = np.array([e.x_c, e.y_c, 0.0])
    contact_a = contact_d + base
    # Eq. (1). The motor turns clamp and beam about the clamp, wherever that truly stands.
    contact_o = apply(turn_about_z(phi), contact_d[None])[0] + base
    stress = e.largest_stress(scene.beam.youngs_modulus_gpa * 1e9) / 1e6
    return {
        "model": "exact, planar, frictionless edge fixed in the world",
        "trial": trial.index,
        "repeat": trial.repeat,
        "push": str(trial.push),
        "contact_distance_at_rest_mm": e.contact_distance / mm,
        "deflection_pct": float(e.tip[1]) / e.beam.length / PERCENT,
        "pushing_angle_deg": e.pushing_angle / DEGREE,
        "motor_angle_deg": phi / DEGREE,
        "x_c_mm": e.x_c / mm,
        "y_c_mm": e.y_c / mm,
        "s_c_mm": e.s_c / mm,
        "theta_c_deg": e.theta_c / DEGREE,
        "psi_deg": 0.0,
        "force_n": e.force,
        "force_antenna_n": [-e.force * np.sin(e.theta_c), e.force * np.cos(e.theta_c), 0.0],
        "contact_antenna_mm": (contact_a / mm).tolist(),
        "contact_world_mm": (contact_o / mm).tolist(),
        "tip_mm": (e.tip / mm).tolist(),
        "base_moment_n_mm": e.moment / mm,
        "largest_stress_mpa": stress,
        "above_yield": stress > scene.beam.yield_stress_mpa,
        "residual": e.residual,
        "contact_row": e.contact_row,
        "centreline_s_mm": (e.centreline[:, 0] / mm).tolist(),
        "centreline_x_mm": (e.centreline[:, 1] / mm).tolist(),
        "centreline_y_mm": (e.centreline[:, 2] / mm).tolist(),
    }


def dataset_facts(scene: Scene, rig: TrueRig, exposure: float, variant: str) -> dict[str, Any]:
    """The truth of a whole dataset, for its manifest."""
    camera, mm = rig.camera, MILLIMETRE
    return {
        "scene": scene.model_dump(mode="json"),
        "seed": scene.seed,
        "variant": variant,
        "exposure_e_per_radiance": exposure,
        "true_rig": {
            "beam_length_mm": rig.beam.length / mm,
            "beam_diameter_mm": rig.beam.diameter / mm,
            "flexural_rigidity_n_mm2": rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "base_position_mm": (rig.base_position / mm).tolist(),
            "antenna_from_board": rig.antenna_from_board.tolist(),
            "camera": {
                "width_px": camera.width,
                "height_px": camera.height,
                "fx_px": camera.fx,
                "fy_px": camera.fy,
                "cx_px": camera.cx,
                "cy_px": camera.cy,
                "camera_from_antenna": camera.camera_from_antenna.tolist(),
            },
        },
    }
