"""What the solver saw in a frame, beside what was: for pictures."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from solver.centreline.area_weighted import area_weighted
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.images import eight_bit, read_grey
from solver.instrument.transforms import apply
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.score.layout import Results
from vbaa_bench.score.stage import camera_frame_from_clamp


@dataclass(frozen=True)
class Overlay:
    """Pixels (u, v): true centreline (n, 2), true contact (2,) or None where nothing is touched,
    extracted points (m, 2), and the estimated contact of each method (2,), put on the true
    centreline at the estimated x_c."""

    frame_id: str
    title: str
    image: Grey
    centreline: Floats
    contact: Floats | None
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
    x, y, z = (np.array(row[f"centreline_{axis}_mm"]) for axis in "xyz")
    stage = camera_frame_from_clamp(truth, row["pushing_angle_deg"] * DEGREE)

    def pixels(at: Floats) -> Floats:
        points = np.column_stack([at, np.interp(at, x, y), np.interp(at, x, z)])
        return truth.camera.project(apply(stage, points * MILLIMETRE))

    answered = scores.filter((pl.col("frame_id") == frame_id) & ~pl.col("failed"))
    estimates = {
        name: pixels(np.array([x_c]))[0]
        for name, x_c in answered.select("method", "x_c_mm").drop_nulls().iter_rows()
    }
    title, contact = "no contact", None
    if row["x_c_mm"] is not None:
        title = (
            f"x_c = {row['x_c_mm']:.4g} mm, deflection {row['deflection_pct']:.2g} %, "
            f"force {1e3 * row['force_n']:.3g} mN"
        )
        contact = pixels(np.array([row["x_c_mm"]]))[0]
    return Overlay(
        frame_id=frame_id,
        title=title,
        image=eight_bit(image),
        centreline=pixels(x),
        contact=contact,
        points=_extracted(image),
        estimates=estimates,
    )


def _extracted(image: Grey) -> Floats:
    """The points (m, 2) that the solver's extraction finds."""
    return area_weighted(image).points
