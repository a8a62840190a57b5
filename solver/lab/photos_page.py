"""Page with pictures: every photograph with its traced and its fitted beam."""

import base64
from html import escape
from typing import Final

import cv2

from solver.instrument.arrays import Floats
from solver.instrument.images import eight_bit, read_grey
from solver.lab.photos_table import rows_of, summary
from solver.photographs.fit import principal_point
from solver.photographs.line import fitted_line
from solver.photographs.solve import PhotosAnswer

# Width of a picture in the page [px]. Chosen: a photograph is a hundred kilobytes.
_WIDTH: Final = 960
_QUALITY: Final = 80


def page(answer: PhotosAnswer) -> str:
    """Write an HTML page that needs no network. Raises InputError if an image cannot be read."""
    figures = "".join(_figure(answer, i) for i in range(len(answer.answers)))
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width"><title>Photographs of a beam</title>'
        f"<style>{_STYLE}</style></head><body><h1>Photographs of a beam</h1>"
        f"<pre>{escape(summary(answer))}</pre>"
        "<p>Green: points of the beam. Red: points that the fit rejects. Blue: the fitted beam, "
        f"with its load.</p>{figures}</body></html>\n"
    )


_STYLE: Final = (
    ":root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:1000px;"
    "margin:2rem auto;padding:0 1rem}pre{white-space:pre-wrap}figure{margin:2rem 0}"
    "svg{width:100%;height:auto}.fit{fill:none;stroke:#2b7bff;stroke-width:2;"
    "vector-effect:non-scaling-stroke}.kept{fill:#3c3}.rejected{fill:#e33}"
    ".load{fill:none;stroke:#2b7bff;stroke-width:3;vector-effect:non-scaling-stroke}"
)


def _figure(answer: PhotosAnswer, i: int) -> str:
    image = eight_bit(read_grey(answer.photos.photographs[i].path))
    height, width = image.shape
    factor = min(_WIDTH / width, 1.0)
    small = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    picture = base64.b64encode(data.tobytes()).decode()
    row = rows_of(answer)[i]
    dot = width / 700
    return (
        f"<figure><figcaption><b>{escape(str(row['file']))}</b>: {row['outcome']}. "
        f"{escape(str(row['message']))}</figcaption>"
        f'<svg viewBox="-0.5 -0.5 {width} {height}" role="img">'
        f'<image x="-0.5" y="-0.5" width="{width}" height="{height}" '
        f'href="data:image/jpeg;base64,{picture}"/>{_drawn(answer, i, dot)}</svg></figure>'
    )


def _drawn(answer: PhotosAnswer, i: int, dot: float) -> str:
    """Draw the points of the beam, the fitted beam and its load as SVG."""
    shown = answer.shown[i]
    if shown is None:
        return ""
    if answer.fit is None or i not in answer.fitted:
        return _dots(shown.beam.points, "rejected", dot)
    k = answer.fitted.index(i)
    kept = answer.fit.fits[k].kept
    line = fitted_line(answer.fit, k)
    middle = principal_point(answer.photos.photographs[i], shown.size)
    course = " ".join(f"{u:.1f},{v:.1f}" for u, v in line.pixels + middle)
    load = ""
    if line.load is not None:
        u, v = line.load + middle
        load = f'<circle class="load" cx="{u:.1f}" cy="{v:.1f}" r="{6 * dot:.1f}"/>'
    return (
        f'<polyline class="fit" points="{course}"/>{load}'
        + _dots(shown.beam.points[kept], "kept", dot)
        + _dots(shown.beam.points[~kept], "rejected", dot)
    )


def _dots(points: Floats, kind: str, radius: float) -> str:
    return "".join(
        f'<circle class="{kind}" cx="{u:.1f}" cy="{v:.1f}" r="{radius:.1f}"/>' for u, v in points
    )
