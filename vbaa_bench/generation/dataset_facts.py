"""The truth of a whole dataset: lengths in mm, angles in degrees."""

from typing import Any

from solver.instrument.units import MILLIMETRE, NEWTON_SQUARE_MILLIMETRE
from vbaa_bench.generation.frame_renderer import Metering
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene


def dataset_facts(scene: Scene, rig: TrueRig, metering: Metering, variant: str) -> dict[str, Any]:
    """Collect the truth of a whole dataset, for its manifest."""
    camera, mm = rig.knocked(scene).camera, MILLIMETRE
    return {
        "scene": scene.model_dump(mode="json"),
        "seed": scene.seed,
        "variant": variant,
        "exposure_per_radiance": metering.exposure,
        "sample_table": metering.table.factors.tolist(),
        "true_rig": {
            "beam_length_mm": rig.beam.length / mm,
            "beam_diameter_mm": rig.beam.diameter / mm,
            "flexural_rigidity_n_mm2": rig.beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE,
            "base_position_mm": (rig.base_position / mm).tolist(),
            "antenna_from_board": rig.antenna_from_board.tolist(),
            # A telecentric camera's fx and fy are in px/m.
            "camera": {
                "width_px": camera.width,
                "height_px": camera.height,
                "fx_px": camera.fx,
                "fy_px": camera.fy,
                "cx_px": camera.cx,
                "cy_px": camera.cy,
                "camera_from_antenna": camera.camera_from_antenna.tolist(),
                "telecentric": camera.telecentric,
                "distortion": list(camera.distortion),
            },
        },
    }
