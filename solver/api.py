"""Open a rig for Python programs: calibrate once, then estimate frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from solver.antenna import Antenna
from solver.centreline.extractors import find_extractor
from solver.fitting.frame_problem import OwnBeamOf
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import open_rig_files
from solver.instrument.units import DEGREE
from solver.lab.check import CalibrationReport, calibration_report
from solver.lab.live import warm_up
from solver.lab.overlay import ImageContact, contact_in_image
from solver.lab.saved_rig import load_tree, save_tree
from solver.learning.frames import frames_to_learn, learn_from_frames, with_learned
from solver.learning.learn import LearnedBeam
from solver.methods import LEARNING, METHODS, Method
from solver.methods.by_name import find_method, with_beam
from solver.set_up import set_up
from solver.tracker import FrameSolution, PushTracker


@dataclass(frozen=True)
class CalibratedRig:
    """A rig whose camera is calibrated and whose beam at rest is known.

    `rest_image` (height, width) is its first image at rest. `beam` is what `learn` has learned.
    """

    antenna: Antenna
    rest_image: Grey
    beam: LearnedBeam | None = None

    def tracker(
        self,
        method: str | Method = "exact_fit",
        *,
        beam: str | OwnBeamOf | None = None,
        warm: bool = False,
    ) -> PushTracker:
        """Return a tracker, which remembers one push, by a method's name or a function.

        `beam` is that of `exact_fit`, or its package.module:function. `warm` compiles all code for
        a frame beforehand. Raises InputError for an unknown name, for a method without a beam, and
        for one that learns the beam unless `learn` has learned it.
        """
        function = find_method(method) if isinstance(method, str) else method
        name = next((name for name in LEARNING if METHODS[name] is function), None)
        if name and self.beam is None:
            raise InputError(
                f"method '{name}' learns the beam before the first frame: "
                f"use rig.learn(frames).tracker('{name}')"
            )
        function = with_beam(function, beam)
        if warm:
            warm_up(self.antenna, function, self.rest_image)
        return PushTracker(self.antenna, function)

    def learn(self, frames: Sequence[ImageFrame]) -> "CalibratedRig":
        """Return the rig with the beam that images of pushes show, as those of `Observations`.

        With splits, the frames of the split "learn" are used. Raises InputError if no beam can be
        learned from them.
        """
        beam = learn_from_frames(self.antenna, frames_to_learn(frames))
        return replace(self, antenna=with_learned(self.antenna, beam), beam=beam)

    def contact_in_image(
        self, solution: FrameSolution, motor_angle_deg: float | None = None
    ) -> ImageContact | None:
        """Project the contact and the force of a tracker's `solve` to the image, for an overlay.

        The measured and rejected points are in `solution.line`. A camera that is fixed in the world
        needs the motor angle, unless it was estimated. Return None without a contact.
        """
        angle = None if motor_angle_deg is None else motor_angle_deg * DEGREE
        return contact_in_image(self.antenna, solution, angle)

    def save(self, path: str | Path) -> None:
        """Write the calibrated rig to a file, with which `load_rig` starts at once.

        Raises InputError if it cannot be written, or if its extractor is a class of the user's own.
        """
        save_tree(Path(path), self)

    def check(self) -> CalibrationReport:
        """Return the calibration's quality, and contradictions of rest images and rig.json."""
        return calibration_report(self.antenna)


def open_rig(path: str | Path, centreline: str = "profile_fit") -> CalibratedRig:
    """Open rig.json, or its folder, with the board and rest images beside it, and calibrate.

    `centreline` is an extractor's name, or package.module:function. Raises InputError where files
    are missing or wrong.
    """
    learn, files = find_extractor(centreline), open_rig_files(Path(path))
    return CalibratedRig(set_up(files, learn), next(files.read_rest_images()))


def load_rig(path: str | Path) -> CalibratedRig:
    """Read a calibrated rig that `CalibratedRig.save` has written.

    The images of board and rest are not read again. Raises InputError if the file cannot be read,
    or was written by another version.
    """
    rig = load_tree(Path(path))
    if not isinstance(rig, CalibratedRig):
        raise InputError(f"{path}: is not a saved rig")
    return rig
