"""Rendering of one frame, with its truth."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import polars as pl

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from vbaa_bench.api.data import usable_variant
from vbaa_bench.api.scene import AnyScene, scene_file
from vbaa_bench.assembly.plan import plan
from vbaa_bench.dataset.manifest import dataset_facts
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.generation.frame_renderer import METERED, FrameRenderer, Metering, metered_frames
from vbaa_bench.report.gallery import whole
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scoring.overlay import Overlay, overlay_of

# Narrower images are enlarged by 2 for display. Chosen: they still fit a screen.
_NARROW_PX: Final = 1000


@dataclass(frozen=True)
class Frame:
    """One frame as written by `generate`, which a notebook displays as an image.

    `image` is gray, (height, width); `readings` holds its columns of metadata.csv, `truth` its row
    of truth.parquet, and `layers` all truth layers (height, width, ...) by name.
    """

    image: Grey
    readings: Mapping[str, str | float | int]
    truth: Mapping[str, Any]
    layers: Mapping[str, np.ndarray]
    _truth: Truth

    @cached_property
    def overlay(self) -> Overlay:
        """The image with its truth, to be drawn."""
        return overlay_of(self._truth, self.truth, self.image, {})

    @property
    def title(self) -> str:
        """Contact distance, deflection and force in words."""
        return self.overlay.title

    def __repr__(self) -> str:
        height, width = self.image.shape
        return f"Frame({width} x {height} px, {self.overlay.title})"

    def png(self) -> bytes:
        """Encode the image with the true centreline and a cross at the contact, for display."""
        scale = 2 if self.image.shape[1] < _NARROW_PX else 1
        _, data = cv2.imencode(".png", whole(self.overlay, scale))
        return bytes(data)

    def _repr_png_(self) -> bytes:
        return self.png()


def render_frame(scene: AnyScene, number: int = 0, *, variant: str | None = None) -> Frame:
    """Render one frame of a scene, the same as in the scene's dataset.

    `number` counts the frames in the order of the scene's pushes: it is the column `trial` of the
    truth. Raises InputError for an impossible scene, and for a frame that the scene does not have.

    >>> import vbaa_bench as vb
    >>> camera = {"width_px": 256, "height_px": 88, "focal_length_px": 350}
    >>> camera |= {"position_mm": [120, 22, 360], "look_at_mm": [120, 22, 0]}
    >>> board = {"columns": 20, "rows": 5, "square_mm": 10, "center_mm": [120, 22]}
    >>> pushes = {"contact_distance_mm": [120], "deflection_pct": [5, 10]}
    >>> scene = vb.Scene(title="One push", seed=1, pushes=pushes, camera=camera, calibration=board)
    >>> frame = vb.render_frame(scene, 1)
    >>> frame
    Frame(256 x 88 px, x_c = 119.6 mm, deflection 10 %, force 67.1 mN)
    >>> frame.image.shape, round(frame.truth["s_c_mm"], 1), sorted(frame.layers)[:2]
    ((88, 256), 120.1, ['arc_length', 'beam_mask'])
    """
    return rendered_frame(scene_file(scene), number, usable_variant(variant))


def rendered_frame(
    file: SceneFile, number: int, variant: str, *, exact: bool = True, threads: int = 0
) -> Frame:
    """Render one frame of a scene, as `render_frame` does.

    With `exact` false it is not the same as in the dataset to the last digit of its noise: the
    numbers of samples are not corrected, which takes longer than the frame itself.
    """
    frames = Frames(file.scene)
    if not 0 <= number < frames.count:
        raise InputError(f"frame {number} does not exist, allowed is 0 to {frames.count - 1}")
    indices = {number, *(METERED if exact else ())} & set(range(frames.count))
    planned = plan(file, pushes={frames.push_of(index) for index in indices})
    specs, rig = list(planned.frame_specs), planned.rig
    spec = next(spec for spec in specs if spec.index == number)
    renderer = FrameRenderer(file.scene, rig, file.folder.resolve(), variant, threads)
    if exact:
        metering = renderer.meter(metered_frames(specs))
    else:
        metering = Metering(renderer.measure_exposure())
    rendered = renderer.frame(spec, metering)
    row = {"frame_id": spec.frame_id, **rendered.truth}
    facts = dataset_facts(file.scene, rig, variant, metering.exposure, metering.table.factors)
    truth = Truth(Path(), facts, pl.DataFrame([row], infer_schema_length=None))
    return Frame(rendered.image, rendered.readings, row, rendered.layers, truth)
