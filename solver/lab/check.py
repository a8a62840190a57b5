"""Report on the calibration and the beam at rest, as text and as JSON."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from solver.antenna import Antenna
from solver.instrument.image_frame import ImageFrame
from solver.instrument.units import DEGREE, MILLIMETRE
from solver.lab.error_budget import ErrorBudget, error_budget
from solver.lab.findings import Finding, findings

# Thresholds above (for MIN_WIDTH_PX: below) which the report contains a warning; chosen.
MAX_REPROJECTION_PX = 0.2
MAX_SCALE_SIGMA = 2e-3
MIN_WIDTH_PX = 1.2
MAX_ROUGHNESS_PX = 0.05


@dataclass(frozen=True)
class CalibrationReport:
    """Calibration and beam at rest; units are in the names, noise is in the image's gray values.

    `focal` is in px, for a telecentric camera in px/mm. `height_mm` is the height of the camera
    above plane C, `leaning_deg` the angle between its optical axis and C's normal. Sigmas are None
    if the calibration has no covariance. `lengths_sigma_pct` is the uncertainty of lengths along
    the beam due to the calibration's own noise. `bow_mm` is the largest distance of the beam at
    rest from a line, 0 if no bow was detected. `roughness_px` is the part of a centre's error that
    is not due to sensor noise. `beam` to `roughness_px` are None for a centreline that does not
    learn the beam's appearance. `ground_images` is the number of images of the ground without the
    beam, `ground_gain` and `ground_shift_px` are light and place of the rest images against them,
    None where they are not used. `budget` is that of a usual push, None where it is not estimated.
    `findings` are contradictions between images and rig.json.
    """

    reprojection_px: float
    telecentric: bool
    focal: float
    focal_sigma: float | None
    principal_u_px: float
    principal_v_px: float
    principal_u_sigma_px: float | None
    principal_v_sigma_px: float | None
    viewpoint_known: bool
    height_mm: float | None
    height_sigma_mm: float | None
    leaning_deg: float
    lengths_sigma_pct: float
    pixel_mm: float
    rest_y_mm: float
    rest_slope_deg: float
    bow_mm: float
    bow_share: float
    noise_dark: float
    noise_per_gray: float
    beam: str | None
    width_px: float | None
    spread_px: float | None
    roughness_px: float | None
    ground_images: int
    ground_gain: float | None
    ground_shift_px: tuple[float, float] | None
    budget: ErrorBudget | None
    findings: tuple[Finding, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What impairs the estimates or contradicts rig.json, with remedies."""
        warnings = []
        if self.reprojection_px > MAX_REPROJECTION_PX:
            warnings.append("poor board fit: blurred views, bent board, or more lens distortion")
        if not self.viewpoint_known:
            warnings.append(
                "one board view works with 0 coefficients, as in the paper, for methods restricted "
                "to plane C"
            )
        if 0.01 * self.lengths_sigma_pct > MAX_SCALE_SIGMA:
            warnings.append("large scale uncertainty: add closer board views that fill the image")
        if self.width_px is not None and self.width_px < MIN_WIDTH_PX:
            warnings.append("beam too narrow in the image: move closer or use more pixels")
        if self.roughness_px is not None and self.roughness_px > MAX_ROUGHNESS_PX:
            warnings.append("rough beam or uneven light: errors of centres exceed the image noise")
        return (*warnings, *(finding.message for finding in self.findings))

    @property
    def meaning(self) -> str:
        """Assessment with warnings and remedies, one in a line."""
        lines = (f"warning: {warning}" for warning in self.warnings)
        return "\n".join(lines) if self.warnings else "good: no problem found"

    def json(self) -> str:
        """Format as one line of JSON."""
        values = asdict(self) | {"findings": [finding._asdict() for finding in self.findings]}
        if self.budget is not None:
            shares = [share._asdict() for share in self.budget.shares]
            values["budget"] = self.budget._asdict() | {"shares": shares}
        return json.dumps(values | {"meaning": self.meaning})

    def text(self) -> str:
        """Format as a few lines of text."""
        focal_unit = "px/mm" if self.telecentric else "px"
        viewpoint = "known" if self.viewpoint_known else "unknown: only plane C was calibrated"
        height = (
            "at infinity (telecentric)"
            if self.height_mm is None
            else f"{_with_sigma(self.height_mm, self.height_sigma_mm)} mm above plane C"
        )
        bow = f"bow {self.bow_mm:.3f} mm (subtracted)" if self.bow_mm else "straight"
        principal = ", ".join(
            _with_sigma(value, sigma)
            for value, sigma in (
                (self.principal_u_px, self.principal_u_sigma_px),
                (self.principal_v_px, self.principal_v_sigma_px),
            )
        )
        appearance = "not learned by this centreline"
        if self.beam is not None:
            appearance = (
                f"{self.beam}, width {self.width_px:.2f} px, blur {self.spread_px:.2f} px (sigma), "
                f"roughness {self.roughness_px:.3f} px"
            )
        rows = (
            ("reprojection RMS", f"{self.reprojection_px:.3f} px"),
            ("focal length", f"{_with_sigma(self.focal, self.focal_sigma)} {focal_unit}"),
            ("principal point", f"{principal} px"),
            ("camera", f"{height}, tilt {self.leaning_deg:.2f} deg"),
            ("viewpoint", viewpoint),
            (
                "scale in plane C",
                f"+- {self.lengths_sigma_pct:.2g} %, pixel size {self.pixel_mm:.3g} mm",
            ),
            (
                "beam at rest",
                f"y = {self.rest_y_mm:.3f} mm at the clamp, "
                f"slope {self.rest_slope_deg:.3f} deg, {bow}",
            ),
            (
                "image noise",
                f"variance {self.noise_dark:.3g} + {self.noise_per_gray:.3g} x gray value",
            ),
            ("beam appearance", appearance),
            ("ground", self._ground),
            ("expected errors", "" if self.budget is None else self.budget.text),
            ("assessment", self.meaning),
        )
        shown = (row for row in rows if row[1])
        indent = "\n" + 17 * " "
        aligned = ((name, value.replace("\n", indent)) for name, value in shown)
        return "\n".join(f"{name:16} {value}" for name, value in aligned)

    @property
    def _ground(self) -> str:
        """Describe the use of images of the ground without the beam; "" if there are none."""
        if not self.ground_images:
            return ""
        images = f"{self.ground_images} images without the beam"
        if self.ground_gain is None or self.ground_shift_px is None:
            return f"{images}, not used"
        u, v = self.ground_shift_px
        return (
            f"{images}, used: since then the light is {self.ground_gain:.3f} times as bright, and "
            f"the image has shifted by {u:.3f}, {v:.3f} px"
        )


def calibration_report(
    antenna: Antenna,
    frames: Sequence[ImageFrame] = (),
    ground_images: int = 0,
    of_files: Sequence[Finding] = (),
) -> CalibrationReport:
    """Collect the report on an antenna, with what `frames` of pushes contradict, if there are any.

    `ground_images` is the number of images of the ground without the beam, for a centreline that
    does not learn the beam's appearance; `of_files` are the findings about the rig's files.
    """
    calibration, rest, noise = antenna.calibration, antenna.rest, antenna.at_rest.noise
    camera, detector = calibration.camera, antenna.extract.detector
    look = None if detector is None else detector.appearance
    bare = None if look is None else look.bare_ground
    ground = None if look is None else look.ground_at_rest
    match = None if bare is None or ground is None or not ground.bare_images else bare.match
    sigmas: list[float | None] = [None] * 3
    if calibration.covariance is not None:
        sigmas = [float(sigma) for sigma in np.sqrt(np.diag(calibration.covariance)[:3])]
    bow, _ = rest.bow_at(np.linspace(0.0, rest.length, 50))
    bow_size = float(np.abs(bow).max())
    height, height_sigma = _height(antenna)
    axis = camera.camera_from_antenna[2, :3]
    return CalibrationReport(
        reprojection_px=calibration.reprojection_px,
        telecentric=camera.telecentric,
        focal=camera.fx * (MILLIMETRE if camera.telecentric else 1.0),
        focal_sigma=sigmas[0],
        principal_u_px=camera.cx,
        principal_v_px=camera.cy,
        principal_u_sigma_px=sigmas[1],
        principal_v_sigma_px=sigmas[2],
        viewpoint_known=calibration.viewpoint_known,
        height_mm=height,
        height_sigma_mm=height_sigma,
        leaning_deg=math.acos(min(abs(float(axis[2])), 1.0)) / DEGREE,
        lengths_sigma_pct=100 * antenna.scale_sigma,
        pixel_mm=antenna.pixel / MILLIMETRE,
        rest_y_mm=rest.y_at_clamp / MILLIMETRE,
        rest_slope_deg=math.atan(rest.slope) / DEGREE,
        bow_mm=bow_size / MILLIMETRE,
        bow_share=bow_size / rest.length,
        noise_dark=noise.dark,
        noise_per_gray=noise.per_gray,
        beam=None if look is None else "bright" if look.polarity > 0 else "dark",
        width_px=None if look is None else 2 * look.section.radius,
        spread_px=None if look is None else look.section.spread,
        roughness_px=None if look is None else look.sigma_px,
        ground_images=ground_images if bare is None else bare.images,
        ground_gain=None if match is None else match.gain,
        ground_shift_px=None if match is None else (float(match.shift[0]), float(match.shift[1])),
        budget=error_budget(antenna),
        findings=(*of_files, *findings(antenna, frames)),
    )


def _height(antenna: Antenna) -> tuple[float | None, float | None]:
    """Compute the camera's height above plane C and its sigma [mm]; None if telecentric."""
    calibration = antenna.calibration
    camera = calibration.camera
    if camera.telecentric:
        return None, None
    height = float(camera.viewpoint[2]) / MILLIMETRE
    if calibration.covariance is None:
        return height, None
    camera_from_board = camera.camera_from_antenna @ antenna.rig.antenna_from_board
    normal, shift = camera_from_board[:3, 2], camera_from_board[:3, 3]
    # Derivatives by the board's rotation and shift: height = -normal . shift, and a rotation t
    # changes the normal by t x normal.
    derivatives = np.concatenate([np.cross(normal, shift), normal])
    variance = float(derivatives @ calibration.covariance[-6:, -6:] @ derivatives)
    return height, math.sqrt(variance) / MILLIMETRE


def _with_sigma(value: float, sigma: float | None) -> str:
    return f"{value:.2f}" if sigma is None else f"{value:.2f} +- {sigma:.2g}"
