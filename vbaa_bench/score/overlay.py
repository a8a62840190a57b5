"""What the solver saw in a frame, beside what was: for pictures."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from solver.centreline.area_weighted import area_weighted
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.images import read_grey
from solver.instrument.units import MILLIMETRE
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.score.layout import Results


@dataclass(frozen=True)
class Overlay:
    """Pixels (u, v): true centreline (n, 2), true contact (2,), extracted points (m, 2), and the
    estimated contact of each method (2,), put on the true centreline at the estimated x_c."""

    frame_id: str
    title: str
    image: Grey
    centreline: Floats
    contact: Floats
    points: Floats
    estimates: dict[str, Floats]


def overlay(results: Results, truth: Truth, scores: pl.DataFrame, frame_id: str) -> Overlay:
    """The overlay of one frame."""
    paths = list(results.dataset.observations.glob(f"shard_*/{frame_id}.png"))
    if not paths:
        raise InputError(
            f"{results.dataset.observations}: the image of frame {frame_id} is missing"
        )
    image = read_grey(paths[0])
    row = truth.frames.row(by_predicate=pl.col("frame_id") == frame_id, named=True)
    base = np.array(truth.manifest["true_rig"]["base_position_mm"])
    x, y = np.array(row["centreline_x_mm"]), np.array(row["centreline_y_mm"])

    def pixels(at: Floats) -> Floats:
        height = np.interp(at, x, y)
        points = np.column_stack([at, height, np.zeros_like(at)]) + base
        return truth.camera.project(points * MILLIMETRE)

    answered = scores.filter((pl.col("frame_id") == frame_id) & ~pl.col("failed"))
    estimates = {
        name: pixels(np.array([x_c]))[0]
        for name, x_c in answered.select("method", "x_c_mm").drop_nulls().iter_rows()
    }
    return Overlay(
        frame_id=frame_id,
        title=(
            f"x_c = {row['x_c_mm']:.2f} mm, deflection {row['deflection_pct']:.0f} %, "
            f"force {1e3 * row['force_n']:.1f} mN"
        ),
        image=image,
        centreline=pixels(x),
        contact=pixels(np.array([row["x_c_mm"]]))[0],
        points=area_weighted(image).points,
        estimates=estimates,
    )
