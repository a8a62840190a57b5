"""Write the report of a scored dataset or collection: report.html, and figures of the README."""

import importlib.metadata
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.hashes import read_bytes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.readers import Truth, open_manifest, open_truth
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.report import gallery
from vbaa_bench.report.budget import read_budget
from vbaa_bench.report.changes import changes_since
from vbaa_bench.report.chart import chart_png
from vbaa_bench.report.page import Contents, page
from vbaa_bench.report.rig_picture import most_bent
from vbaa_bench.report.views import by_error
from vbaa_bench.report.worst import Row
from vbaa_bench.scoring.overlay import Overlay, antenna_of, overlay
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores, read_summary

# Factors of a table and pictures of rigs. Chosen: they stay below a megabyte.
_FACTORS: Final = 6
_TILES: Final = 24


class _Report(NamedTuple):
    """Contents of a page, and the pictures beside it by their file names."""

    contents: Contents
    pictures: dict[str, bytes]


def report(
    results: Results,
    baseline: Path | None = None,
    set_up_antenna: Callable[[Results], tuple[Any, str]] = antenna_of,
) -> Path:
    """Write the report of a scored dataset or collection; return the path of the page.

    With a baseline file, the page shows what changed. The information limits are shown if the
    scores hold them, and the error budget if it was computed. `set_up_antenna` returns the solver's
    antenna of a dataset, or None and the reason. Raises InputError.
    """
    summary, scores = read_summary(results), read_scores(results)
    common = {
        "scores": scores,
        "environment": {**summary["machine"], **summary["versions"]},
        "budget": read_budget(results.dataset.derived / "budget.json"),
        "changes": changes_since(baseline, results.root) if baseline else None,
        "made_by": f"vbaa-bench {importlib.metadata.version('vbaa-bench')}: "
        f"vbaa-bench report {results.root.resolve().name}",
    }
    if is_collection(results.root):
        contents, pictures = _of_collection(results, scores, common)
    else:
        contents, pictures = _of_dataset(results, scores, common, set_up_antenna)
    made = page(contents)
    files = {
        "report.html": made.html.encode(),
        "speed_against_error.png": chart_png(made.speed, made.colours),
        **pictures,
    }
    write_results(results.report, files)
    return results.report / "report.html"


def _of_dataset(
    results: Results,
    scores: pl.DataFrame,
    common: dict[str, Any],
    set_up_antenna: Callable[[Results], tuple[Any, str]],
) -> _Report:
    truth = open_manifest(results.dataset.truth)
    antenna, reason = set_up_antenna(results)

    @cache
    def drawn(frame_id: str) -> Overlay:
        return overlay(results, truth, scores, frame_id, antenna)

    contents = Contents(
        title=truth.manifest["scene"]["title"],
        facts=_facts(truth, scores),
        overlay_of=lambda row: drawn(row["frame_id"]),
        unmeasured=reason
        and f"The solver cannot be set up, so the centreline is not measured ({reason})",
        **common,
    )
    colours = gallery.colours_of(by_error(scores))
    picture = gallery.overlay_png(drawn(most_bent(scores)["frame_id"]), colours)
    return _Report(contents, {"overlay.png": picture})


def _facts(truth: Truth, scores: pl.DataFrame) -> list[str]:
    rig, manifest = truth.manifest["true_rig"], truth.manifest
    return [
        f"{scores['frame_id'].n_unique()} frames, seed {manifest['seed']}, rendered with "
        f"{manifest['variant']}.",
        f"L = {rig['beam_length_mm']:g} mm, d = {rig['beam_diameter_mm']:g} mm, "
        f"EI = {rig['flexural_rigidity_n_mm2']:.1f} N mm².",
    ]


def _of_collection(results: Results, scores: pl.DataFrame, common: dict[str, Any]) -> _Report:
    """Collect all rigs together, and the factors that matter."""
    layout = CollectionLayout(results.root)
    scene = layout.read_scene()
    factors = pl.read_csv(read_bytes(results.scores / "factors.csv"), infer_schema_length=None)
    rigs = _Rigs(layout, scores)
    contents = Contents(
        title=scene["title"],
        facts=[
            f"{scores['rig'].n_unique()} rigs with {scores.unique(['rig', 'frame_id']).height} "
            f"frames, seed {scene['seed']}.",
            "Each rig has its own beam, camera, calibration and rest images. Errors are in % "
            "of the rig's beam length.",
        ],
        overlay_of=rigs.overlay_of,
        unmeasured="The centreline is measured in the reports of single rigs only",
        factors={name: _worst_factors(factors, name) for name in by_error(scores)},
        rigs=rigs.tiles(),
        **common,
    )
    return _Report(contents, {})


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
            picture = gallery.whole(drawn, 1)
            tiles.append(
                {"caption": f"rig {number}: {drawn.title}", "picture": gallery.webp_uri(picture)}
            )
        return tiles
