"""Write the report of a scored collection: all rigs together, and the factors that matter."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.hashes import read_bytes
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.report import gallery
from vbaa_bench.report.budget import read_budget
from vbaa_bench.report.changes import changes_since
from vbaa_bench.report.figures import speed_png
from vbaa_bench.report.page import Contents, page
from vbaa_bench.report.views import by_error
from vbaa_bench.report.worst import Row
from vbaa_bench.scoring.overlay import Overlay, overlay
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores, read_summary

# Factors of a table and pictures of rigs. Chosen: they stay below a megabyte.
_FACTORS: Final = 6
_TILES: Final = 24


def collection_report(root: Path, baseline: Path | None = None) -> Path:
    """Write the report of a scored collection; return the path of the page.

    With a baseline file, the page shows what changed. Raises InputError.
    """
    results, layout = Results(root), CollectionLayout(root)
    summary, scene = read_summary(results), layout.read_scene()
    scores = read_scores(results)
    factors = pl.read_csv(read_bytes(results.scores / "factors.csv"), infer_schema_length=None)
    methods = by_error(scores)
    rigs = _Rigs(layout, scores)
    made = page(
        Contents(
            title=scene["title"],
            facts=[
                f"{summary['rigs']} rigs with {scores.unique(['rig', 'frame_id']).height} frames, "
                f"seed {scene['seed']}.",
                "Each rig has its own beam, camera, calibration and rest images. Errors are in % "
                "of the rig's beam length.",
            ],
            scores=scores,
            overlay_of=rigs.overlay_of,
            environment={**summary["machine"], **summary["versions"]},
            unmeasured="The centreline is measured in the reports of single rigs only",
            budget=read_budget(results.dataset.derived / "budget.json"),
            changes=changes_since(baseline, root) if baseline else None,
            factors={name: _worst_factors(factors, name) for name in methods},
            rigs=rigs.tiles(),
        )
    )
    files = {
        "report.html": made.html.encode(),
        "speed_against_error.png": speed_png(made.speed, methods),
    }
    write_results(results.report, files)
    return results.report / "report.html"


def _worst_factors(factors: pl.DataFrame, method: str) -> list[dict[str, Any]]:
    """List the groups of the factors that matter most; the table has them in this order."""
    if factors.is_empty():
        return []
    rows = factors.filter(pl.col("method") == method)
    names = rows["factor"].unique(maintain_order=True)[:_FACTORS]
    return rows.filter(pl.col("factor").is_in(names.to_list())).to_dicts()


class _Rigs:
    """Truth and pictures of the rigs of a collection, read when they are needed."""

    def __init__(self, layout: CollectionLayout, scores: pl.DataFrame) -> None:
        self._layouts, self._scores = layout.rigs(), scores
        self._truth = cache(self._open)

    def _open(self, number: int) -> Truth:
        return open_truth(self._layouts[number].truth, centrelines=False)

    def overlay_of(self, row: Row) -> Overlay:
        """Draw the frame of a row of the scores."""
        return self._overlay(row["rig"], row["frame_id"])

    def _overlay(self, number: int, frame_id: str) -> Overlay:
        of_rig = self._scores.filter(pl.col("rig") == number)
        return overlay(Results(self._layouts[number].root), self._truth(number), of_rig, frame_id)

    def tiles(self) -> list[dict[str, str]]:
        """Draw one frame each of rigs spread over the collection."""
        numbers = list(self._layouts)
        chosen = {numbers[int(i)] for i in np.linspace(0, len(numbers) - 1, _TILES)}
        tiles = []
        for number in sorted(chosen):
            frames = self._truth(number).frames
            drawn = self._overlay(number, frames["frame_id"][number % frames.height])
            drawn = replace(drawn, estimates={})
            picture = gallery.strip(drawn, {}, 1, margin_px=max(drawn.image.shape))
            tiles.append(
                {"caption": f"rig {number}: {drawn.title}", "picture": gallery.webp_uri(picture)}
            )
        return tiles
