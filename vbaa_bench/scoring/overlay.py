"""Data of an overlay picture: truth, measured centreline and estimates in one frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from solver.antenna import Antenna
from solver.instrument.arrays import Floats, Grey
from solver.instrument.centreline import Centreline
from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import MEND
from solver.instrument.images import eight_bit, read_grey
from solver.instrument.observation import open_rig_files
from solver.instrument.transforms import apply
from solver.instrument.units import DEGREE, MILLIMETRE
from solver.set_up import set_up
from solver.tracker import extract_centreline
from vbaa_bench.dataset.readers import Truth, read_frame
from vbaa_bench.scoring.camera_frame import camera_frame_from_clamp
from vbaa_bench.scoring.results_layout import Results


@dataclass(frozen=True)
class Overlay:
    """Truth, measurement and estimates of one frame, in pixels (u, v).

    `centreline` (n, 2) is the true centreline, `contact` (2,) the true contact, None without
    contact. `measured` is the solver's own centreline, None if it cannot be measured. `estimates`
    (2,) are the methods' contacts, drawn on the true centreline at the estimated x_c.
    """

    frame_id: str
    title: str
    image: Grey
    centreline: Floats
    contact: Floats | None
    measured: Centreline | None
    estimates: dict[str, Floats]


def overlay(
    results: Results,
    truth: Truth,
    scores: pl.DataFrame,
    frame_id: str,
    antenna: Antenna | None = None,
) -> Overlay:
    """Make the overlay of one frame.

    `antenna` is set up by the solver from the dataset's observations; without it no centreline is
    measured. The centreline is read from the frame's shard; `truth` need not have any. Raises
    InputError if the image is missing.
    """
    paths = list(results.dataset.observations.glob(f"shard_*/{frame_id}.png"))
    if not paths:
        raise InputError(
            f"{results.dataset.observations}: the image of frame {frame_id} is missing; {MEND}"
        )
    row = read_frame(truth.root / paths[0].parent.name, frame_id)
    answered = scores.filter((pl.col("frame_id") == frame_id) & ~pl.col("failed"))
    estimates = dict(answered.select("method", "x_c_mm").drop_nulls().iter_rows())
    return overlay_of(truth, row, read_grey(paths[0]), estimates, antenna)


def force_text(force_n: float) -> str:
    """Format a force [N] with three digits, in N, mN or uN: 1.61 N, 67.1 mN."""
    scale, unit = next(
        ((scale, unit) for scale, unit in ((1.0, "N"), (1e-3, "mN")) if abs(force_n) >= scale),
        (1e-6, "uN"),
    )
    return f"{np.format_float_positional(force_n / scale, 3, fractional=False, trim='-')} {unit}"


def overlay_of(
    truth: Truth,
    row: Mapping[str, Any],
    image: Grey,
    estimates_mm: Mapping[str, float],
    antenna: Antenna | None = None,
) -> Overlay:
    """Project the truth of a frame, a row of `truth.frames`, and estimates of x_c onto its image.

    Only the manifest of `truth` is used, which includes the camera.
    """
    x, y, z = (np.array(row[f"centreline_{axis}_mm"]) for axis in "xyz")
    frame_from_clamp = camera_frame_from_clamp(truth, row["true_motor_angle_deg"] * DEGREE)

    def pixels(distances: Floats) -> Floats:
        points = np.column_stack(
            [distances, np.interp(distances, x, y), np.interp(distances, x, z)]
        )
        return truth.camera.project(apply(frame_from_clamp, points * MILLIMETRE))

    title, contact = "no contact", None
    if row["x_c_mm"] is not None:
        title = (
            f"x_c = {row['x_c_mm']:.4g} mm, deflection {row['deflection_pct']:.2g} %, "
            f"force {force_text(row['force_n'])}"
        )
        contact = pixels(np.array([row["x_c_mm"]]))[0]
    return Overlay(
        frame_id=row["frame_id"],
        title=title,
        image=eight_bit(image),
        centreline=pixels(x),
        contact=contact,
        measured=None if antenna is None else _measured(antenna, image),
        estimates={name: pixels(np.array([x_c]))[0] for name, x_c in estimates_mm.items()},
    )


def antenna_of(results: Results) -> tuple[Antenna | None, str]:
    """Set up the solver's antenna from the observations; if that fails, return None and the reason.

    Raises DamageError if board views or rest images are not what was generated.
    """
    try:
        return set_up(open_rig_files(results.dataset.observations)), ""
    except DamageError:
        raise
    except (InputError, ValueError) as error:
        return None, str(error)


def _measured(antenna: Antenna, image: Grey) -> Centreline | None:
    """Extract the default centreline of this image; return None if it cannot be measured."""
    try:
        return extract_centreline(antenna, image)
    except (InputError, ValueError):  # the methods return "invalid" here
        return None
