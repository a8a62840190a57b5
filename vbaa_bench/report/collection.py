"""Write the report of a scored collection: all rigs together, and the factors that matter."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes, write_text
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.manifest import read_json
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.report import calibration, figures, gallery
from vbaa_bench.report.charts import png, svg, template
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.overlay import overlay

# Rows of tables and tiles of the gallery. Chosen: a page of a megabyte.
_FACTORS: Final = 6
_WORST: Final = 30
_TILES: Final = 24
_MESSAGES: Final = 40


def collection_report(root: Path) -> Path:
    """Write the report of a scored collection; return the path of the page. Raises InputError."""
    results, layout = Results(root), CollectionLayout(root)
    if not (results.scores / "summary.json").is_file():
        raise InputError(f"{results.scores}: holds no scores; score the collection first")
    summary, scene = read_json(results.scores / "summary.json"), read_json(layout.scene)
    scores = pl.read_parquet(results.scores / "scores.parquet")
    factors = pl.read_csv(results.scores / "factors.csv", infer_schema_length=None)
    methods = list(summary["methods"])
    colours = gallery.colours_of(methods)
    css = {name: gallery.colour_name(colour) for name, colour in colours.items()}
    speed = figures.speed_against_error(summary, css)
    page = template("collection.html.jinja").render(
        title=scene["title"],
        seed=scene["seed"],
        rigs=summary["rigs"],
        frames=scores["frame_id"].n_unique(),
        methods=summary["methods"],
        speed=svg(speed),
        most_factors=_FACTORS,
        factors={name: _worst_factors(factors, name) for name in methods},
        calibrations=[svg(chart) for chart in calibration.calibrations(scores, css)],
        truth_colour=gallery.colour_name(gallery.TRUTH),
        legend=css.items(),
        gallery=_gallery(layout, scores, colours),
        worst=_worst_frames(scores),
        failures=_failures(scores),
        environment={**summary["machine"], **summary["versions"]},
    )
    target = results.report / "report.html"
    try:
        results.report.mkdir(parents=True, exist_ok=True)
        write_text(target, page)
        write_bytes(results.report / "speed_against_error.png", png(speed))
    except OSError as error:
        raise InputError(f"{results.report}: cannot be written ({error.strerror})") from error
    return target


def _worst_factors(factors: pl.DataFrame, method: str) -> list[dict[str, Any]]:
    """List the groups of the factors that matter most; the table has them in this order."""
    if factors.is_empty():
        return []
    rows = factors.filter(pl.col("method") == method)
    names = rows["factor"].unique(maintain_order=True)[:_FACTORS]
    return rows.filter(pl.col("factor").is_in(names.to_list())).to_dicts()


def _gallery(
    layout: CollectionLayout, scores: pl.DataFrame, colours: gallery.Colours
) -> list[dict[str, Any]]:
    """Draw one frame each of rigs spread over the collection."""
    rigs = layout.rigs()
    numbers = list(rigs)
    chosen = {numbers[int(i)] for i in np.linspace(0, len(numbers) - 1, _TILES)}
    tiles = []
    for number in sorted(chosen):
        truth = open_truth(rigs[number].truth)
        frame_id = truth.frames["frame_id"][number % truth.frames.height]
        of_rig = scores.filter(pl.col("rig") == number)
        drawn = overlay(Results(rigs[number].root), truth, of_rig, frame_id)
        picture = gallery.strip(drawn, colours, 1, margin_px=max(drawn.image.shape))
        tiles.append({"rig": number, "title": drawn.title, "picture": gallery.webp_uri(picture)})
    return tiles


def _worst_frames(scores: pl.DataFrame) -> list[dict[str, Any]]:
    outside = scores.filter(~pl.col("consistent") & pl.col("x_c_error_in_sigmas").is_not_null())
    order = pl.col("x_c_error_in_sigmas").abs()
    return outside.sort(order, descending=True).head(_WORST).to_dicts()


def _failures(scores: pl.DataFrame) -> list[dict[str, Any]]:
    """Count failures by method, outcome and message, whose numbers are left out."""
    failed = scores.filter("failed").with_columns(
        pl.col("message").str.replace_all(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "…")
    )
    groups = failed.group_by("method", "outcome", "message", maintain_order=True).agg(
        frames=pl.len(), rigs=pl.col("rig").n_unique()
    )
    return groups.sort("frames", descending=True).head(_MESSAGES).to_dicts()
