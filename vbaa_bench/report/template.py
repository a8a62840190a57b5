"""Templates of pages, with the formats of numbers that all pages share."""

import functools

import jinja2

from vbaa_bench.report import numbers
from vbaa_bench.report.chart import key


@functools.cache
def template(name: str) -> jinja2.Template:
    """Load a template of the package, as ROOM/FILE; it is compiled once."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("vbaa_bench", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "short": numbers.short,
        "signed": numbers.signed,
        "percent": numbers.percent,
        "key": key,
    }
    return environment.get_template(name)
