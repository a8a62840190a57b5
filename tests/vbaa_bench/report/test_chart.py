"""Charts as PNG have the page's paper and the colours of their classes."""

import cv2
import numpy as np

from vbaa_bench.report.chart import Axis, Plot, chart_png


def test_a_chart_is_opaque_and_in_its_colours() -> None:
    plot = Plot(Axis("x", 0, 1), Axis("y", 0, 1), (300, 200), "a line")
    plot.line(np.array([0.1, 0.9]), np.array([0.5, 0.5]), class_="curve m0")
    data = np.frombuffer(chart_png(plot.svg(), {"m0": "#ff0000"}, scale=2), np.uint8)
    picture = np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED))
    assert picture.shape[:2] == (400, 600)
    assert picture.shape[2] == 3 or picture[..., 3].min() == 255
    assert (picture[0, 0, :3] == 255).all()
    assert (picture[..., :3] == (0, 0, 255)).all(axis=-1).sum() > 300
