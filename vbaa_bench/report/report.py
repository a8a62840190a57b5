"""Write the report of a scored dataset: report.html, and the figures of the README."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl

from vbaa_bench.dataset.readers import Truth, open_manifest
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.report.budget import read_budget
from vbaa_bench.report.changes import changes_since
from vbaa_bench.report.figures import overlay_png, speed_png
from vbaa_bench.report.gallery import colours_of
from vbaa_bench.report.page import Contents, page
from vbaa_bench.report.views import by_error
from vbaa_bench.scoring.overlay import Overlay, antenna_of, overlay
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores, read_summary


def report(
    results: Results,
    baseline: Path | None = None,
    set_up_antenna: Callable[[Results], tuple[Any, str]] = antenna_of,
) -> Path:
    """Write the report of a scored dataset; return the path of the page.

    With a baseline file, the page shows what changed. The information limits are shown if the
    scores hold them, and the error budget if it was computed. `set_up_antenna` returns the solver's
    antenna, or None and the reason. Raises InputError.
    """
    truth = open_manifest(results.dataset.truth)
    summary, scores = read_summary(results), read_scores(results)
    antenna, reason = set_up_antenna(results)

    @cache
    def drawn(frame_id: str) -> Overlay:
        return overlay(results, truth, scores, frame_id, antenna)

    made = page(
        Contents(
            title=truth.manifest["scene"]["title"],
            facts=_facts(truth, scores),
            scores=scores,
            overlay_of=lambda row: drawn(row["frame_id"]),
            environment={**summary["machine"], **summary["versions"]},
            unmeasured=reason
            and f"The solver cannot be set up, so the centreline is not measured ({reason})",
            budget=read_budget(results.dataset.derived / "budget.json"),
            changes=changes_since(baseline, results.root) if baseline else None,
        )
    )
    methods = by_error(scores)
    files = {
        "report.html": made.html.encode(),
        "speed_against_error.png": speed_png(made.speed, methods),
        "overlay.png": overlay_png(drawn(_most_bent(scores)), colours_of(methods)),
    }
    write_results(results.report, files)
    return results.report / "report.html"


def _facts(truth: Truth, scores: pl.DataFrame) -> list[str]:
    rig, manifest = truth.manifest["true_rig"], truth.manifest
    return [
        f"{scores['frame_id'].n_unique()} frames, seed {manifest['seed']}, rendered with "
        f"{manifest['variant']}.",
        f"L = {rig['beam_length_mm']:g} mm, d = {rig['beam_diameter_mm']:g} mm, "
        f"EI = {rig['flexural_rigidity_n_mm2']:.1f} N mm².",
    ]


def _most_bent(scores: pl.DataFrame) -> str:
    order = (pl.col("deflection_pct").round(1), "true_x_c_mm", "frame_id")
    return str(
        scores.select("frame_id", "deflection_pct", "true_x_c_mm").sort(*order)["frame_id"][-1]
    )
