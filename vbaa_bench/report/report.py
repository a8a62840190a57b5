"""Write report.html and the figures of the README from scores."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes, write_text
from vbaa_bench.dataset.manifest import read_json
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.report import calibration, figures, gallery
from vbaa_bench.report.charts import png, svg, template
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.overlay import Overlay, antenna_of, overlay
from vbaa_bench.scoring.score import read_scores

MAX_FAILURES = 100
GALLERY_FRAMES = 6


def report(results: Results) -> Path:
    """Write the report of a scored dataset; return the path of the page. Raises InputError."""
    truth = open_truth(results.dataset.truth)
    if not (results.scores / "summary.json").is_file():
        raise InputError(f"{results.scores}: holds no scores; score the dataset first")
    summary = read_json(results.scores / "summary.json")
    scores = figures.group_pushes(read_scores(results))
    methods = list(summary["methods"])
    colours = gallery.colours_of(methods)
    rig = truth.manifest["true_rig"]
    length, rigidity = rig["beam_length_mm"], rig["flexural_rigidity_n_mm2"]
    antenna, unmeasured = antenna_of(results)
    overlays = [overlay(results, truth, scores, name, antenna) for name in _chosen_frames(truth)]
    css = {name: gallery.colour_name(colour) for name, colour in colours.items()}
    speed = figures.speed_against_error(summary, css)
    page = template("page.html.jinja").render(
        title=truth.manifest["scene"]["title"],
        most_dots=figures.MAX_DOTS,
        frames=truth.frames.height,
        seed=truth.manifest["seed"],
        variant=truth.manifest["variant"],
        length_mm=f"{length:g}",
        diameter_mm=f"{rig['beam_diameter_mm']:g}",
        rigidity=rigidity,
        methods=summary["methods"],
        speed=svg(speed),
        fig8=[
            (
                svg(figures.fig8_contact_distance(scores, name)),
                svg(figures.fig8_force(scores, name, length, rigidity)),
            )
            for name in (methods if figures.is_fig8(scores) else [])
        ],
        further_errors=[svg(chart) for chart in calibration.further_errors(scores, css)],
        calibrations=[svg(chart) for chart in calibration.calibrations(scores, css)],
        errors=[svg(figures.error_against_distance(scores, name)) for name in methods],
        truth_colour=gallery.colour_name(gallery.TRUTH),
        points_colour=gallery.colour_name(gallery.POINTS),
        tip_colour=gallery.colour_name(gallery.TIP),
        rejected=[
            (flag.name.lower(), gallery.colour_name(colour))
            for flag, colour in gallery.REJECTED.items()
        ],
        unmeasured=unmeasured,
        legend=css.items(),
        gallery=[
            {
                "title": frame.title,
                "frame_id": frame.frame_id,
                "strip": gallery.webp_uri(gallery.strip(frame, colours)),
                "close_up": gallery.webp_uri(gallery.close_up(frame, colours)),
            }
            for frame in overlays
        ],
        **_failures(scores),
        environment={**summary["machine"], **summary["versions"]},
    )
    target = results.report / "report.html"
    try:
        results.report.mkdir(parents=True, exist_ok=True)
        write_text(target, page)
        write_bytes(results.report / "speed_against_error.png", png(speed))
        _, picture = cv2.imencode(".png", _readme_image(overlays[-1], colours))
        write_bytes(results.report / "overlay.png", bytes(picture))
    except OSError as error:
        raise InputError(f"{results.report}: cannot be written ({error.strerror})") from error
    return target


def _chosen_frames(truth: Truth) -> list[str]:
    """Choose frames spread over deflection and contact distance, the most bent one last."""
    ordered = truth.frames.sort(pl.col("deflection_pct").round(1), "x_c_mm")["frame_id"]
    count = min(GALLERY_FRAMES, len(ordered))
    return [ordered[int(position)] for position in np.linspace(0, len(ordered) - 1, count)]


def _failures(scores: pl.DataFrame) -> dict[str, Any]:
    failed = scores.filter("failed").sort("method", "frame_id")
    columns = ["method", "frame_id", "true_x_c_mm", "deflection_pct", "outcome", "message"]
    rows = failed.select(columns).head(MAX_FAILURES).to_dicts()
    return {"failures": rows, "more_failures": max(failed.height - MAX_FAILURES, 0)}


def _readme_image(frame: Overlay, colours: gallery.Colours) -> np.ndarray:
    """Draw the frame and its enlarged contact side by side, for the README."""
    strip, close_up = gallery.strip(frame, colours), gallery.close_up(frame, colours, scale=6)
    height = max(len(strip), len(close_up))
    canvases = []
    for canvas in (strip, close_up):
        padded = np.full((height, canvas.shape[1], 3), 255, np.uint8)
        padded[: len(canvas)] = canvas
        canvases.append(padded)
    return np.hstack([canvases[0], np.full((height, 8, 3), 255, np.uint8), canvases[1]])
