"""Layout of a recording in the viewer rerun: space, image, values over time, ellipses, a table."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from solver.instrument.units import MILLIMETRE
from vbaa_bench.viewer.ellipse_plot import HALF
from vbaa_bench.viewer.frames import ViewedDataset
from vbaa_bench.viewer.plots import Series

# Entity of the camera and its image.
IMAGE: Final = "space/camera"
# Direction from which space is shown. Chosen: from the side of the object, and from above.
_FROM: Final = np.array([0.25, -1.0, 0.3])
# Chosen: the steps of a push can be followed.
_FRAMES_PER_SECOND: Final = 4.0


def blueprint(data: ViewedDataset, series: Sequence[Series]) -> Any:
    """Lay out the views of a recording; each of `series` has a plot over time."""
    import rerun.blueprint as rrb  # an extra, which takes a second to import

    camera, rim = data.truth.camera, 1.12 * HALF
    # A telecentric camera has no pyramid in which its image could be shown.
    contents = "/space/3d/**" if camera.telecentric else "/space/**"
    space = rrb.Spatial3DView(
        origin="/space", contents=contents, name="space [mm]", eye_controls=_eye(rrb, data)
    )
    image_range = rrb.VisualBounds2D(x_range=[0, camera.width], y_range=[0, camera.height])
    image = rrb.Spatial2DView(origin=f"/{IMAGE}", name="image", visual_bounds=image_range)
    # The ellipses are in the colours of the first plot's legend.
    plots = [
        rrb.TimeSeriesView(
            origin=f"/{one.name}",
            name=one.heading,
            plot_legend=rrb.PlotLegend(visible=number == 0, corner=rrb.Corner2D.RightBottom),
        )
        for number, one in enumerate(series)
    ]
    errors = rrb.Spatial2DView(
        origin="/errors",
        name="errors of x_c and force, 95 % ellipses",
        visual_bounds=rrb.VisualBounds2D(x_range=[-rim, rim], y_range=[-rim, rim]),
    )
    table = rrb.TextDocumentView(origin="/table", name="truth and estimates")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(space, image, row_shares=[3, 2]),
            rrb.Vertical(*plots, row_shares=[3, *[2] * (len(plots) - 1)]),
            rrb.Vertical(errors, table, row_shares=[3, 2]),
            column_shares=[4, 3, 3],
        ),
        rrb.TimePanel(timeline="frame", state="collapsed", fps=_FRAMES_PER_SECOND),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _eye(rrb: Any, data: ViewedDataset) -> Any:
    """Look at the middle between the beam and the camera, from where both are in view."""
    length, camera = data.truth.manifest["true_rig"]["beam_length_mm"], data.truth.camera
    beam = np.array([length / 2, 0.0, 0.0])
    lens = beam if camera.telecentric else camera.viewpoint[:3] / MILLIMETRE
    target = (beam + lens) / 2
    distance = max(0.9 * (float(np.linalg.norm(lens - beam)) + length / 2), 1.1 * length)
    position = target + distance * _FROM / np.linalg.norm(_FROM)
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))
