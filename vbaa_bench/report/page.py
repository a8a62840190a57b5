"""The page of a report, for a dataset and for a collection alike."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from typing import Any

import polars as pl
from markupsafe import Markup

from vbaa_bench.report import palette
from vbaa_bench.report.budget import Share
from vbaa_bench.report.changes import Changes
from vbaa_bench.report.heat_map import with_bins
from vbaa_bench.report.method_statistics import with_groups
from vbaa_bench.report.numbers import short
from vbaa_bench.report.residuals import MAX_DOTS, figures, panels
from vbaa_bench.report.rig_picture import most_bent, rig_picture
from vbaa_bench.report.speed_chart import CLAIM_PCT
from vbaa_bench.report.template import template
from vbaa_bench.report.views import by_error, views
from vbaa_bench.report.worst import Row, worst_frames
from vbaa_bench.scoring.overlay import Overlay
from vbaa_bench.scoring.statistics import FACTOR
from vbaa_bench.scoring.strata import reported_strata


@dataclass(frozen=True)
class Contents:
    """What a report shows beside its statistics.

    `facts` are sentences on the data, `made_by` the version and the command.
    `unmeasured` is the reason why frames have no measured centreline, "" if they have. `changes`
    is a comparison with a baseline. `factors` and `rigs` are of collections only: groups of factors
    by method, and pictures of rigs with captions.
    """

    title: str
    facts: Sequence[str]
    scores: pl.DataFrame
    overlay_of: Callable[[Row], Overlay]
    environment: Mapping[str, Any]
    made_by: str = ""
    unmeasured: str = ""
    budget: Mapping[str, Sequence[Share]] = field(default_factory=dict)
    changes: Changes | None = None
    factors: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    rigs: Sequence[Mapping[str, str]] = ()


@dataclass(frozen=True)
class Page:
    """The page as HTML, and its first chart for other uses: as SVG, with colours by CSS class."""

    html: str
    speed: Markup
    colours: Mapping[str, str]


def page(contents: Contents) -> Page:
    """Compute and write the page."""
    scores, bins = with_bins(with_groups(contents.scores))
    methods = by_error(scores)
    styles = palette.styles(methods)
    classes = {name: f"m{number}" for number, name in enumerate(methods)}
    chosen = reported_strata(scores, partial(short, digits=3))
    example = contents.overlay_of(most_bent(scores))
    worst = worst_frames(scores, methods, chosen, contents.overlay_of)
    shown = views(scores, methods, chosen, bins, styles, classes)
    html = template("report/page.html.jinja").render(
        contents=contents,
        views=shown,
        menu=[(h, list(g)) for h, g in groupby(shown, key=lambda view: view.heading)],
        bins=bins,
        figures=[panels(scores, one, methods, classes, chosen) for one in figures(scores)],
        most_dots=MAX_DOTS,
        example=example,
        rig_picture=rig_picture(example),
        worst=worst,
        flags=[flag for flag in palette.FLAGS if any(flag in frame.flags for frame in worst)],
        claim_pct=CLAIM_PCT,
        methods=methods,
        styles=styles,
        classes=classes,
        palette=palette,
        limited=bool(bins.relative),
        factor_heads=[statistic.heading.report for statistic in FACTOR.values()],
    )
    return Page(html, shown[0].wide, {classes[name]: styles[name].light for name in methods})
