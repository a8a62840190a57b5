"""Compare information limits of frames by their two roads: re-rendered images and the closed form.

Clamp, beam and camera are known here; brightness of beam and background and the width are not. Two
closed forms are compared: one with the radiance across the beam as rendered, which has the rendered
image's light, and the one of the scene's lamps and paints, by which datasets get their limits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, Final

import numpy as np
from scipy.spatial import KDTree

from results.limits.rendered import ImageChange, precise_change
from results.limits.rendered_beam import STEP_PX
from results.limits.rendered_profile import RenderedProfiles, rendered_profiles
from solver.instrument.arrays import Floats
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.limits.image_shape import (
    ImageShape,
    PlacesInformation,
    image_information,
    image_shape,
)
from vbaa_bench.limits.imaged_beam import CONTACT, PLACES, ImagedBeam
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.profile import SHIFT, PixelNoise, information
from vbaa_bench.limits.quantities import QUANTITIES, SECOND, gradients
from vbaa_bench.limits.rig_information import RigInformation
from vbaa_bench.limits.tip import BeamEnd, tip_information
from vbaa_bench.scene.frames import FrameSpec, frame_specs
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.rigs import true_rig
from vbaa_bench.workers.resources import cores

# A vertical shift of the whole image.
_SHIFT: Final = "cy"
PARAMETERS: Final = (*CONTACT, _SHIFT)
# Equal parts of the length in which the information on a shift is compared, if they have at least
# this share of it.
_PARTS, _LEAST_SHARE = 10, 0.02
# Step from one chosen frame to the next, as a fraction of all: never in step with a scene's axes.
_GOLDEN: Final = 0.6180339887
# Those of a single contact.
_QUANTITIES: Final = QUANTITIES[: -len(SECOND)]

Record = dict[str, Any]


@dataclass(frozen=True)
class LitScene:
    """A scene whose frames can be rendered, with its exposure."""

    file: SceneFile
    variant: str

    @cached_property
    def renderer(self) -> FrameRenderer:
        """Renderer of its frames; nothing is written."""
        scene, folder = self.file.scene, self.file.folder
        return FrameRenderer(scene, true_rig(scene), folder, self.variant, cores())

    @cached_property
    def exposure(self) -> float:
        """Exposure as metered for a dataset."""
        return self.renderer.measure_exposure()

    @cached_property
    def rig_information(self) -> RigInformation:
        """Closed form of the information of the scene's images."""
        return RigInformation(self.file.scene, self.renderer.rig, self.file.folder)

    def frames(self, count: int) -> list[FrameSpec]:
        """Choose frames that are spread over the scene's axes."""
        specs = sorted(frame_specs(self.file.scene), key=lambda spec: spec.index)
        places = [(number + 1) * _GOLDEN % 1 for number in range(count)]
        return [specs[int(place * len(specs))] for place in places]


@dataclass(frozen=True)
class LimitedFrame:
    """One frame with a contact, and its information by each road."""

    lit: LitScene
    spec: FrameSpec

    @cached_property
    def imaged(self) -> ImagedBeam:
        """The beam before the camera."""
        renderer = self.lit.renderer
        pose = renderer.pose(self.spec)
        return ImagedBeam.of(pose, renderer.pushed_world(pose).camera)

    @cached_property
    def quantities(self) -> Floats:
        """Gradients (4, 3) of _QUANTITIES with respect to CONTACT."""
        pose = self.lit.renderer.pose(self.spec)
        (at_rest,) = pose.experiment.rest.points_at(np.array([pose.state.contact.s]))
        return gradients(self.imaged.neighbours(CONTACT), at_rest).quantities[: len(_QUANTITIES)]

    def sigmas(self, data: Information, *, plane_is_known: bool) -> Floats:
        """Compute the limits (4,) of _QUANTITIES, with the rig known."""
        known = {_SHIFT, *(CONTACT[2:] if plane_is_known else ())}
        own = data.without(known)
        rows = [dict(zip(CONTACT, row, strict=True)) for row in self.quantities]
        return own.sigmas(own.gradients(rows))

    def rendered(self, step_px: float = STEP_PX) -> ImageChange:
        """Re-render the image with changed parameters."""
        lit = self.lit
        return precise_change(
            lit.renderer, self.spec, lit.exposure, PARAMETERS, step_px=step_px, seed=1
        )

    @cached_property
    def shape(self) -> ImageShape:
        """Change of the beam's image."""
        return image_shape(self.imaged, self.imaged.neighbours(PARAMETERS))

    @cached_property
    def profiles(self) -> RenderedProfiles:
        """Rendered radiance across the beam, and its visible places."""
        renderer = self.lit.renderer
        return rendered_profiles(renderer, renderer.pose(self.spec), self.shape)

    @cached_property
    def of_places(self) -> Floats:
        """Information (n, 4, 4) of the profile as rendered."""
        return np.array([information(one, self._noise.variance) for one in self.profiles.surfaces])

    def closed(self) -> Information:
        """Compute the closed form of the rendered profiles, the tip where it is in its pixel."""
        end, last = BeamEnd.of(self.imaged), self.profiles.surfaces[-1]
        of_tip = self.profiles.visible[-1] * tip_information(last, end, self._noise.variance)
        visible = self.profiles.visible[:, None, None]
        return image_information(self.shape, PlacesInformation(visible * self.of_places, of_tip))

    def of_lamps(self) -> Information:
        """Compute the closed form from the scene's lamps and paints."""
        state = self.lit.renderer.pose(self.spec).state
        return self.lit.rig_information.of_image(
            self.imaged,
            state,
            self.imaged.neighbours(PARAMETERS),
            self.profiles.visible,
            self.spec.scene,
        )

    def shift_ratios(self, change: ImageChange) -> Floats:
        """Divide standard deviations of a shift, rendered by closed, in parts of the length."""
        row, parts = PARAMETERS.index(_SHIFT), np.arange(PLACES) * _PARTS // PLACES
        across = self.shape.across[row] ** 2 * self.of_places[:, SHIFT, SHIFT]
        closed = np.bincount(parts, across * self.shape.steps * self.profiles.visible)
        own = change.slopes[0, row] * change.slopes[1, row] / change.variance
        _, nearest = KDTree(self.shape.pixels).query(change.pixels)
        rendered = np.bincount(parts[nearest], own, minlength=_PARTS)
        enough = closed > _LEAST_SHARE * closed.sum()
        return np.asarray(np.sqrt(closed[enough] / rendered[enough]))

    @property
    def _noise(self) -> PixelNoise:
        sensor = self.lit.renderer.sensor(self.lit.exposure)
        return PixelNoise.of(self.lit.file.scene.sensor, sensor)


def agreement(lit: LitScene, spec: FrameSpec) -> Record:
    """Compare the limits of one frame. Raises EquilibriumError."""
    frame = LimitedFrame(lit, spec)
    frame.rendered()  # compiles kernels
    start = perf_counter()
    change = frame.rendered()
    seconds = perf_counter() - start
    half, double = (frame.rendered(factor * STEP_PX) for factor in (0.5, 2.0))
    closed, lamps = frame.closed(), frame.of_lamps()
    shifts = frame.shift_ratios(change)
    record: Record = {
        "scene": lit.file.path.stem,
        "frame": spec.index,
        "seconds": seconds,
        "shift_ratio_min": float(shifts.min()),
        "shift_ratio_max": float(shifts.max()),
    }
    others = {
        "half_step": half.information,
        "double_step": double.information,
        "closed": closed,
        "lamps": lamps,
    }
    for name, known in (("planar", True), ("image", False)):
        # psi is the last of them.
        counted = len(_QUANTITIES) - known
        own = frame.sigmas(change.information, plane_is_known=known)[:counted]
        record[name] = {"limits": dict(zip(_QUANTITIES, own.tolist(), strict=False))}
        for other, data in others.items():
            limits = frame.sigmas(data, plane_is_known=known)[:counted]
            record[name][other] = (own / limits).tolist()
    return record


def lines(records: Sequence[Record]) -> list[tuple[str, ...]]:
    """Format records as rows of a table, two per frame; HEADS are the columns."""
    rows = []
    for record in records:
        for name in ("planar", "image"):
            own = record[name]
            limits = own["limits"]
            psi = limits.get("psi")
            steps = max(abs(r - 1) for key in ("half_step", "double_step") for r in own[key])
            rows.append(
                (
                    f"{record['scene']} {record['frame']}",
                    "known" if name == "planar" else "unknown",
                    f"{1e3 * limits['x_c']:.2g}",
                    f"{1e3 * limits['force']:.2g}",
                    "–" if psi is None else f"{np.degrees(psi):.2g}",
                    f"{100 * steps:.1f}",
                    *(" / ".join(f"{r:.2f}" for r in own[key]) for key in ("closed", "lamps")),
                    f"{record['shift_ratio_min']:.2f}–{record['shift_ratio_max']:.2f}",
                    f"{record['seconds']:.1f}",
                )
            )
    return rows


HEADS: Final = (
    "scene, frame",
    "psi",
    "x_c, mm",
    "force, mN",
    "psi, deg",
    "step, %",
    "rendered / closed",
    "rendered / lamps",
    "shift",
    "s",
)
