"""Templates of pages, and charts as pictures."""

import altair as alt
import jinja2
import vl_convert as vlc

from vbaa_bench.report.figures import Chart


def template(name: str) -> jinja2.Template:
    """Load a page's template."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("vbaa_bench.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["g"] = lambda value: "–" if value is None else f"{value:.3g}"
    environment.filters["percent"] = lambda fraction: (
        "–" if fraction is None else f"{100 * fraction:.3g}"
    )
    environment.filters["has"] = lambda methods, key: any(
        values.get(key) is not None for values in methods.values()
    )
    environment.filters["span"] = lambda pair: (
        "–" if pair is None else f"{pair[0]:.3g} … {pair[1]:.3g}"
    )
    return environment.get_template(name)


def svg(chart: Chart) -> str:
    """Render a chart as SVG."""
    return str(vlc.vegalite_to_svg(_json(chart)))


def png(chart: Chart) -> bytes:
    """Render a chart as PNG."""
    return bytes(vlc.vegalite_to_png(_json(chart), scale=2))


def _json(chart: Chart) -> str:
    """Convert a chart and its data to JSON, also with more rows than Altair's limit.

    Dots are limited elsewhere; the curves of many methods may have many rows.
    """
    with alt.data_transformers.disable_max_rows():
        return chart.to_json()
