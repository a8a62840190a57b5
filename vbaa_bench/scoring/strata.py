"""Strata: classes of conditions under which methods are compared, over all datasets alike."""

from collections.abc import Sequence
from typing import Any, Final

import polars as pl

from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.scene_values import scene_value

NO_CONTACT: Final = "no contact"
# Limits of the classes. Chosen: between the values of the paper's experiments, so that small
# deviations from these change no class; each class is about twice as wide as the one before.
_DEFLECTION_PCT: Final = (1.0, 3.0, 7.0, 14.0, 28.0)
_DISTANCE_PCT_L: Final = (10.0, 30.0, 55.0, 80.0, 95.0)
_AVAILABILITY_PCT: Final = (25.0, 45.0, 65.0, 85.0, 99.0)
_PSI_DEG: Final = (5.0, 15.0, 35.0, 65.0)
_NOISE_PCT: Final = (0.5, 1.0, 2.0, 4.0)


def strata(truth: Truth) -> pl.DataFrame:
    """Return the strata of each frame: `frame_id` and the columns STRATA, all of them texts.

    Classes are of the tip's deflection and the contact distance in % of L, the availability
    ratio (eq. 32), |psi|, and the noise of a pixel in % of the beam's peak: shot and read noise of
    the scene's image sensor. `light` is the kind of the first light.
    """
    length = truth.manifest["true_rig"]["beam_length_mm"]
    touched = pl.col("x_c_mm").is_not_null()
    availability = (
        pl.col("availability_seen").cast(pl.Float64)
        if "availability_seen" in truth.frames.columns
        else pl.lit(None, pl.Float64)
    )
    distance = 100 / length * pl.col("x_c_mm").cast(pl.Float64)
    psi = pl.col("psi_deg").cast(pl.Float64).abs()
    return truth.frames.select(
        "frame_id",
        deflection_class=_class(pl.col("deflection_pct"), _DEFLECTION_PCT, "%"),
        contact_distance_class=_if(touched, _class(distance, _DISTANCE_PCT_L, "% of L")),
        availability_class=_class(100 * availability.fill_null(1.0), _AVAILABILITY_PCT, "%"),
        psi_class=_if(touched, _class(psi, _PSI_DEG, "deg")),
        light=_light(truth),
        noise_class=_class(_noise_pct(truth), _NOISE_PCT, "%"),
        scene=pl.lit(truth.manifest["scene"].get("title", "")),
    )


def class_order(value: Any) -> tuple[int, float, str]:
    """Make a sort key: numbers by size, texts such as "3 to 7 %" by their first number, None last.

    Other texts are between numbers and None.
    """
    if value is None:
        return (2, 0.0, "")
    words = str(value).rstrip("°").split()
    try:
        return (0, float(words[0]), str(value))
    except (IndexError, ValueError):
        return (1, 0.0, str(value))


def _class(value: pl.Expr, limits: Sequence[float], unit: str) -> pl.Expr:
    """Label the class of a value, such as "3 to 7 %"; the lower limit is included."""
    label = pl.lit(f"{limits[-1]:g} {unit} or more")
    for low, high in reversed(list(zip((0.0, *limits), limits, strict=False))):
        label = pl.when(value < high).then(pl.lit(f"{low:g} to {high:g} {unit}")).otherwise(label)
    return label


def _if(condition: pl.Expr, label: pl.Expr) -> pl.Expr:
    return pl.when(condition).then(label).otherwise(pl.lit(NO_CONTACT))


def _light(truth: Truth) -> pl.Expr:
    lights = truth.manifest["scene"].get("lights") or [{}]
    fixed = lights[0].get("kind", "area above")
    if "drawn.lights.0.kind" in truth.frames.columns:
        return pl.col("drawn.lights.0.kind").fill_null(fixed)
    return pl.lit(fixed)


def _noise_pct(truth: Truth) -> pl.Expr:
    """Return the standard deviation of a pixel at the beam's peak, in % of the peak."""
    well, peak, read = (
        scene_value(truth, f"sensor.{key}", default).cast(pl.Float64)
        for key, default in (("full_well_e", None), ("beam_peak_pct", 100.0), ("read_noise_e", 0.0))
    )
    electrons = well * peak / 100
    return (100 * (electrons + read**2).sqrt() / electrons).fill_null(0.0)  # an ideal sensor
