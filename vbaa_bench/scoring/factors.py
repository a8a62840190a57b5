"""Factors in which the frames of a collection differ, and how much each of them matters."""

from typing import Any, Final

import numpy as np
import polars as pl

from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.statistics import FACTOR

# Groups of equal size of a factor that is a number. Chosen: with 300 rigs, each has 100.
_GROUPS: Final = 3
# Fewer frames say nothing. Chosen: a rate of one half is then known to 8 %.
_MIN_FRAMES: Final = 40
# Prefix of the columns of factors.
PREFIX: Final = "factor."

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
        "light": scene["lights"][0]["kind"] if scene["lights"] else "area above",
    }
    for section, key in _SCENE_KEYS:
        value = (scene.get(section) or {}).get(key)
        if value is not None:
            factors[f"{section}.{key}"] = value
    return {f"{PREFIX}{name}": pl.lit(value) for name, value in factors.items()}


def factor_columns(truth: Truth) -> pl.DataFrame:
    """Return the factors of the frames of a rig: drawn values, deflection, contact and slope."""
    frames = truth.frames
    length = truth.manifest["true_rig"]["beam_length_mm"]
    drawn = [name for name in frames.columns if name.startswith("drawn.")]
    return frames.select(
        "frame_id",
        (pl.col("x_c_mm").cast(pl.Float64) / length).alias(f"{PREFIX}x_c_over_L"),
        pl.col("deflection_pct").alias(f"{PREFIX}deflection_pct"),
        pl.col("theta_c_deg").cast(pl.Float64).alias(f"{PREFIX}theta_c_deg"),
        *(pl.col(name).alias(f"{PREFIX}{name.removeprefix('drawn.')}") for name in drawn),
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

    Numbers are divided into three groups of equal size, except that equal numbers stay together;
    other factors by their values. `spread` is the difference between the consistent shares of the
    best and the worst group of the factor.
    """
    factors = [name for name in scores.columns if name.startswith(PREFIX)]
    if "snr" in scores.columns:
        scores = scores.with_columns(pl.col("snr").alias(f"{PREFIX}snr"))
        factors.append(f"{PREFIX}snr")
    rows: list[dict[str, Any]] = []
    for (method,), of_method in scores.group_by("method", maintain_order=True):
        for factor in factors:
            groups = [
                {"method": method, "factor": factor.removeprefix(PREFIX), **row}
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
    known = scores.drop_nulls(factor)
    values = known[factor]
    if values.n_unique() < 2:
        return []
    if values.dtype.is_numeric() and values.n_unique() > _GROUPS:
        # Equal values have equal ranks: they are in one group, however many they are.
        ranks = ((values.rank("average") - 1) * _GROUPS / known.height).floor()
        parts = [known.filter(ranks == n) for n in range(_GROUPS)]
        named = [(_range(part[factor]), part) for part in parts if part.height]
    else:
        named = [
            (str(value), part)
            for (value,), part in sorted(known.group_by(factor), key=lambda one: str(one[0]))
        ]
    return [
        {"group": name, **{figure: one.of(part) for figure, one in FACTOR.items()}}
        for name, part in named
        if part.height >= _MIN_FRAMES
    ]


def _range(values: pl.Series) -> str:
    low, high = (
        np.format_float_positional(float(end), 3, fractional=False, trim="-")
        for end in (np.min(values.to_numpy()), np.max(values.to_numpy()))
    )
    return low if low == high else f"{low} to {high}"
