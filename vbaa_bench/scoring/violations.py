"""Assumptions that the truth of a frame violates, by more than the rig states.

A rig states each value with a sigma. The truth violates it if it differs by more than three of
them, as an error of a consistent estimate does; a value that is stated without a sigma, such as
that of a uniform beam, is violated by any difference.
"""

from typing import Final

import numpy as np
import polars as pl

from solver.instrument.beam_shape import skew_sigma
from solver.instrument.estimate import Assumption
from solver.instrument.units import DEGREE, PERCENT
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.scene_values import scene_value
from vbaa_bench.scoring.scored_quantities import CONSISTENT_SIGMAS

# Differences below this are rounding, in any of the units below.
_ROUNDING: Final = 1e-9
# An image's light that is more times as bright or dark as at rest, as in the solver's remark.
_LIGHT_RATIO: Final = 1.4
# Bow of a parabola: the tip's distance from the clamp's tangent over the middle's from the chord.
_TIP_OVER_MIDDLE: Final = 4.0


def violations(truth: Truth) -> pl.DataFrame:
    """List for each frame_id the assumptions that do not hold, as `violated`."""
    conditions = [
        pl.when(condition.fill_null(value=False)).then(pl.lit(str(name))).otherwise(None)
        for name, condition in _conditions(truth).items()
    ]
    return truth.frames.select("frame_id", violated=pl.concat_list(conditions).list.drop_nulls())


def _conditions(truth: Truth) -> dict[Assumption, pl.Expr]:
    def value(key: str, default: float) -> pl.Expr:
        return scene_value(truth, key, default).cast(pl.Float64)

    scene, rig = truth.manifest["scene"], truth.manifest["true_rig"]
    stated, beam = scene.get("tolerances") or {}, scene.get("beam") or {}

    def sigma(name: str, unit: float = 1.0) -> float:
        return float(stated.get(name) or 0.0) * unit

    clamp_mm = np.hypot(sigma("base_mm"), sigma("grip_mm"))
    length_mm = np.hypot(sigma("beam_length_mm"), sigma("grip_mm"))
    # Without a stated sigma, the rest images alone determine the bow.
    bow_mm = np.inf if stated.get("bow_mm") is None else sigma("bow_mm")
    plane_deg = skew_sigma(sigma("aspect_ratio_pct", PERCENT)) / DEGREE
    flat = beam.get("section") == "strip"
    stated_plane = value("beam.section_angle_deg", 0.0) if flat else pl.lit(0.0)
    psi = pl.col("psi_deg").cast(pl.Float64)
    drift = scene_value(truth, "object.drift_mm", [0.0] * 3).cast(pl.List(pl.Float64))
    light = value("light_level", 1.0) if _drawn(truth, "light_level") else pl.lit(1.0)
    knock = scene.get("camera", {}).get("knock_px", (0.0, 0.0))
    offset_mm = float(np.linalg.norm(scene.get("clamp_offset_mm", 0.0)))
    taper = _beyond(value("beam.tip_ratio", 1.0) - 1, sigma("tip_ratio_pct", PERCENT))
    friction = _beyond(value("object.friction", 0.0), sigma("friction")).fill_null(value=False)
    return {
        Assumption.TAPER: taper,
        Assumption.BOW: _beyond(_TIP_OVER_MIDDLE * value("beam.bow_mm", 0.0), float(bow_mm)),
        Assumption.CLAMP: _beyond(value("beam.clamp_softness", 0.0), sigma("clamp_softness"))
        | _beyond(pl.lit(float(np.linalg.norm(rig["base_position_mm"]))), float(clamp_mm)),
        Assumption.FRICTION: friction,
        Assumption.TAPER_OR_FRICTION: taper | friction,
        Assumption.GRAVITY: pl.lit(value=False),  # the truth is drawn with the stated sigma
        Assumption.PLANE: _beyond(psi - stated_plane, plane_deg),
        Assumption.SIDE: psi.abs() > 90,
        Assumption.LENGTH: _beyond(
            pl.lit(rig["beam_length_mm"] - float(beam.get("length_mm", rig["beam_length_mm"]))),
            float(length_mm),
        ),
        Assumption.ONE_CONTACT: pl.col("second_s_c_mm").is_not_null(),
        Assumption.RESTING_OBJECT: drift.list.eval(pl.element().abs()).list.max() > _ROUNDING,
        Assumption.MOTOR_AXIS: _beyond(pl.lit(offset_mm), sigma("clamp_offset_mm")),
        Assumption.CAMERA_AT_REST: pl.lit(any(knock)),
        Assumption.LIGHT: ~light.is_between(1 / _LIGHT_RATIO, _LIGHT_RATIO),
    }


def _drawn(truth: Truth, key: str) -> bool:
    return f"drawn.{key}" in truth.frames.columns


def _beyond(difference: pl.Expr, sigma: float) -> pl.Expr:
    return difference.abs() > CONSISTENT_SIGMAS * sigma + _ROUNDING
