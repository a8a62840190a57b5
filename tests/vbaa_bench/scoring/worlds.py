"""A truth written by hand: rows of a table before a camera that looks straight down."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from solver.instrument.camera import Camera
from solver.instrument.transforms import camera_looking_at
from vbaa_bench.dataset.readers import Truth

CAMERA = Camera(
    width=512,
    height=512,
    fx=700.0,
    fy=700.0,
    cx=255.5,
    cy=255.5,
    camera_from_antenna=camera_looking_at(
        np.array([0.12, 0.0, 0.36]), np.array([0.12, 0.0, 0.0]), 0.0
    ),
)
MANIFEST: dict[str, Any] = {
    "scene": {"camera": {"mount": "antenna"}, "clamp_offset_mm": [0.0, 0.0, 0.0]},
    "seed": 1,
    "variant": "",
    "true_rig": {
        "beam_length_mm": 240.0,
        "beam_diameter_mm": 0.8,
        "flexural_rigidity_n_mm2": 4021.2,
        "base_position_mm": [0.0, 0.0, 0.0],
        "camera": {
            "width_px": CAMERA.width,
            "height_px": CAMERA.height,
            "fx_px": CAMERA.fx,
            "fy_px": CAMERA.fy,
            "cx_px": CAMERA.cx,
            "cy_px": CAMERA.cy,
            "camera_from_antenna": CAMERA.camera_from_antenna.tolist(),
            "telecentric": False,
            "distortion": [],
        },
    },
}
TOUCHED: dict[str, Any] = {
    "push": "10 %",
    "step": 0,
    "contact_distance_at_rest_mm": 120.0,
    "deflection_pct": 10.0,
    "pushing_angle_deg": 5.0,
    "normal_deg": 0.0,
    "k_s_n_m": None,
    "k_s_over_k_beam": None,
    "hidden_by": None,
    "hidden_place": None,
    "availability_asked": None,
    "true_motor_angle_deg": -5.0,
    "x_c_mm": 120.0,
    "y_c_mm": 8.0,
    "s_c_mm": 121.0,
    "theta_c_deg": 8.0,
    "psi_deg": 0.0,
    "force_n": 0.1,
    "f_n": 0.098,
    "contact_antenna_mm": [120.0, 8.0, 0.0],
    "contact_world_mm": [120.0, -2.0, 0.0],
    "force_antenna_n": [-0.02, 0.098, 0.0],
    "second_s_c_mm": None,
    "second_force_antenna_n": None,
    "second_contact_antenna_mm": None,
    "visible_share": 1.0,
}
_NOTHING = ("x_c_mm", "y_c_mm", "s_c_mm", "theta_c_deg", "psi_deg", "force_n", "f_n")
_NO_PLACES = ("contact_antenna_mm", "contact_world_mm", "force_antenna_n")
FREE = {
    **TOUCHED,
    **dict.fromkeys((*_NOTHING, *_NO_PLACES)),
    "deflection_pct": 0.0,
}


def truth(*rows: dict[str, Any]) -> Truth:
    """The truth of frames f0, f1, ..., each TOUCHED but for what is said; pushes are one frame."""
    full = [
        {**TOUCHED, "frame_id": f"f{i}", "push_id": f"p{i}", "trial": i, **row}
        for i, row in enumerate(rows)
    ]
    return Truth(Path("nowhere"), MANIFEST, pl.DataFrame(full, infer_schema_length=None))
