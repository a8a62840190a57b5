"""Scores of imaginary methods, with errors of known size, and a page that shows them."""

from typing import Any

import numpy as np
import polars as pl

from tests.draws import generator
from vbaa_bench.report.page import Contents
from vbaa_bench.scoring.computed_scores import COMPUTED
from vbaa_bench.scoring.overlay import Overlay

METHODS = ("exact_fit", "two_point", "push_fit", "two_point@area_weighted", "mine", "yours")


def scores(frames: int, methods: tuple[str, ...] = METHODS) -> pl.DataFrame:
    """Scores with Gaussian errors of x_c: of 0.01 % of L times the deflection over 5 %.

    Method n is n + 1 times as bad as the first. Every tenth frame has no contact, every twentieth
    contact of the second method is refused wrongly, and the last method is not timed.
    """
    return pl.concat(_of_method(frames, n, name) for n, name in enumerate(methods))


def _of_method(frames: int, number: int, name: str) -> pl.DataFrame:
    random = generator(__name__, 0)  # the same frames for all methods
    index = np.arange(frames)
    free = index % 10 == 9
    x_c = random.choice([60.0, 100, 140, 180, 220], frames)
    deflection = random.choice([5.0, 10.0, 20.0], frames)
    normal = random.choice([0.0, 20.0], frames)
    ratio = random.choice([0.1, 1.0, 10.0, np.nan], frames)
    cover = random.choice([1.0, 0.65, 0.35], frames)
    sigma = 0.01 * (number + 1) * deflection / 5
    errors = generator(__name__, number + 1).normal(size=(4, frames))
    refused = (index % 20 == 0) & (number == 1) & ~free
    answered = ~(free | refused)

    def where(values: Any, condition: Any = answered) -> pl.Series:
        condition = np.broadcast_to(condition, frames)
        return pl.Series(np.where(condition, values, np.nan)).fill_nan(None)

    table = pl.DataFrame(
        {
            "frame_id": [f"f{i:06d}" for i in index],
            "method": name,
            "push_id": [f"p{i:06d}" for i in index],
            "step": 0,
            "hidden_place": "middle",
            "information": "planar",
            "x_c_limit_mm": pl.Series([None] * frames, dtype=pl.Float64),
            "x_c_limit_pct_L": pl.Series([None] * frames, dtype=pl.Float64),
            "push": [f"{value:.0f} %" for value in deflection],
            "contact_distance_at_rest_mm": x_c,
            "deflection_pct": np.where(free, 0.0, deflection),
            "normal_deg": normal,
            "k_s_n_m": where(ratio, ~np.isnan(ratio)),
            "k_s_over_k_beam": where(ratio, ~np.isnan(ratio)),
            "hidden_by": "removed",
            "availability_asked": cover,
            "true_x_c_mm": where(x_c, ~free),
            "true_psi_deg": where(normal, ~free),
            "true_force_n": where(0.1, ~free),
            "snr": 1000 * deflection,
            "outcome": np.where(free, "no contact", np.where(refused, "invalid", "contact")),
            "message": pl.Series([None] * frames, dtype=pl.String),
            "image_ms": where(2.0 + number, number < 5),
            "processor_ms": where(2.0 + number, number < 5),
            "reference_ms": where(1.0, number < 5),
            "free": free,
            "failed": refused,
            "rightly_refused": False,
            "x_c_error_mm": where(2.4 * sigma * errors[0]),
            "x_c_error_pct_L": where(sigma * errors[0]),
            "x_c_error_in_sigmas": where(errors[0]),
            "force_error_n": where(0.001 * errors[1]),
            "force_error_pct": where(errors[1]),
            "force_error_in_sigmas": where(2 * errors[1]),
            "psi_error_deg": where(errors[2]),
            "psi_error_in_sigmas": where(errors[2]),
            "compliance_error_pct": where(errors[3], answered & ~np.isnan(ratio)),
            "compliance_error_in_sigmas": where(errors[3]),
        }
    )
    others = [name for name in COMPUTED if name not in table.columns]
    return table.with_columns(pl.lit(None, pl.Float64).alias(name) for name in others)


def limited(table: pl.DataFrame) -> pl.DataFrame:
    """Scores with limits that the first method attains."""
    limit = pl.when(~pl.col("free")).then(0.01 * pl.col("deflection_pct") / 5)
    return table.with_columns(x_c_limit_pct_L=limit, x_c_limit_mm=2.4 * limit)


def overlay_of(row: dict[str, Any]) -> Overlay:
    """A noisy image of a straight beam."""
    image = generator(__name__, 1).integers(10, 40, (512, 512)).astype(np.uint8)
    image[250:253] = 200
    line = np.column_stack([np.linspace(10.0, 500.0, 30), np.full(30, 251.0)])
    contact = None if row["free"] else np.array([200.0, 251.0])
    return Overlay(
        row["frame_id"], "", image, line, contact, None, {row["method"]: np.array([203.0, 251.0])}
    )


def contents(table: pl.DataFrame, **more: Any) -> Contents:
    """Contents of a page of scores."""
    return Contents(
        title="Imaginary methods",
        facts=["No frame was rendered."],
        scores=table,
        overlay_of=overlay_of,
        environment={"python": "3"},
        **more,
    )
