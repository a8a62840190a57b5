"""Factors in which the frames of a collection differ, and how much each of them matters."""

from typing import Any, Final

import numpy as np
import polars as pl

from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.conditions import FACTOR_PREFIX
from vbaa_bench.scoring.scene_values import first_light
from vbaa_bench.scoring.statistics import FACTOR, compute
from vbaa_bench.scoring.strata import factor_groups

# Fewer frames say nothing. Chosen: a rate of one half is then known to 8 %.
_MIN_FRAMES: Final = 40

# Keys of the scene that are factors of a rig, if rigs differ in them.
_SCENE_KEYS: Final = (
    ("beam", "paint"),
    ("beam", "reflectance"),
    ("beam", "tip_ratio"),
    ("beam", "bow_mm"),
    ("beam", "aspect_ratio"),
    ("object", "friction"),
    ("background", "pattern"),
    ("background", "reflectance"),
    ("background", "contrast"),
    ("camera", "roll_deg"),
    ("sensor", "full_well_e"),
    ("sensor", "read_noise_e"),
    ("sensor", "gamma"),
    ("sensor", "jpeg_quality"),
    ("optics", "point_spread_px"),
    ("optics", "vignetting_pct"),
    ("sensor", "bits"),
)


def rig_factors(truth: Truth) -> dict[str, pl.Expr]:
    """Return the factors of a rig as literal columns: its beam, camera, sensor and light."""
    scene, rig = truth.manifest["scene"], truth.manifest["true_rig"]
    factors: dict[str, Any] = {
        "beam_length_over_diameter": rig["beam_length_mm"] / rig["beam_diameter_mm"],
        "beam_width_px": beam_width_px(truth),
        "direction_in_image_deg": _direction_deg(truth),
        "light": first_light(truth),
    }
    for section, key in _SCENE_KEYS:
        value = (scene.get(section) or {}).get(key)
        if value is not None:
            factors[f"{section}.{key}"] = value
    return {f"{FACTOR_PREFIX}{name}": pl.lit(value) for name, value in factors.items()}


def factor_columns(truth: Truth) -> pl.DataFrame:
    """Return the factors of the frames of a rig: drawn values, deflection, contact and slope."""
    frames = truth.frames
    length = truth.manifest["true_rig"]["beam_length_mm"]
    drawn = [name for name in frames.columns if name.startswith("drawn.")]
    return frames.select(
        "frame_id",
        (pl.col("x_c_mm").cast(pl.Float64) / length).alias(f"{FACTOR_PREFIX}x_c_over_L"),
        pl.col("deflection_pct").alias(f"{FACTOR_PREFIX}deflection_pct"),
        pl.col("theta_c_deg").cast(pl.Float64).alias(f"{FACTOR_PREFIX}theta_c_deg"),
        *(pl.col(name).alias(f"{FACTOR_PREFIX}{name.removeprefix('drawn.')}") for name in drawn),
    )


def beam_width_px(truth: Truth) -> float:
    """Compute the width of the beam at its middle in the image [px]."""
    rig = truth.manifest["true_rig"]
    middle = np.array([[rig["beam_length_mm"] / 2000, 0.0, 0.0]])
    scale = float(truth.camera.pixels_per_metre(middle)[0])
    return float(scale * rig["beam_diameter_mm"] / 1000)


def _direction_deg(truth: Truth) -> float:
    """Compute the direction of the beam at rest in the image, clockwise from the right."""
    length = truth.manifest["true_rig"]["beam_length_mm"] / 1000
    base, tip = truth.camera.project(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]))
    return float(np.degrees(np.arctan2(tip[1] - base[1], tip[0] - base[0])))


def factor_table(scores: pl.DataFrame) -> pl.DataFrame:
    """Tabulate errors by factor, one row per method, factor and group; the worst factor first.

    Groups are those of `factor_groups`. `spread` is the difference between the consistent shares of
    the best and the worst group of the factor.
    """
    factors = [name for name in scores.columns if name.startswith(FACTOR_PREFIX)]
    if "snr" in scores.columns:
        scores = scores.with_columns(pl.col("snr").alias(f"{FACTOR_PREFIX}snr"))
        factors.append(f"{FACTOR_PREFIX}snr")
    rows: list[dict[str, Any]] = []
    for (method,), of_method in scores.group_by("method", maintain_order=True):
        for factor in factors:
            groups = [
                {"method": method, "factor": factor.removeprefix(FACTOR_PREFIX), **row}
                for row in _groups(of_method, factor)
            ]
            shares = [row["consistent_pct"] for row in groups]
            if len(groups) > 1:
                rows += [row | {"spread": max(shares) - min(shares)} for row in groups]
    if not rows:
        return pl.DataFrame(schema={"method": pl.String, "factor": pl.String})
    return pl.DataFrame(rows, infer_schema_length=None).sort(
        "method", "spread", "factor", descending=[False, True, False], maintain_order=True
    )


def _groups(scores: pl.DataFrame, factor: str) -> list[dict[str, Any]]:
    return [
        {"group": name, **compute(FACTOR, frames)}
        for name, frames in factor_groups(scores, factor)
        if frames.height >= _MIN_FRAMES
    ]
