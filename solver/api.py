"""Open a rig for Python programs: calibrate once, then estimate frame by frame."""

from dataclasses import dataclass
from pathlib import Path

from solver.antenna import Antenna
from solver.centreline.extractors import find_extractor
from solver.instrument.arrays import Grey
from solver.instrument.observation import open_rig as open_rig_files
from solver.lab.check import CalibrationReport, calibration_report
from solver.lab.live import warm_up
from solver.methods import Method
from solver.methods.by_name import find_method
from solver.set_up import set_up
from solver.tracker import PushTracker


@dataclass(frozen=True)
class CalibratedRig:
    """A rig whose camera is calibrated and whose beam at rest is known.

    `rest_image` (height, width) is its first image at rest.
    """

    antenna: Antenna
    rest_image: Grey

    def tracker(self, method: str | Method = "exact_fit", *, warm: bool = False) -> PushTracker:
        """Return a tracker with the memory of one push, by a method's name or a function.

        `warm` compiles all code for a frame beforehand. Raises InputError for an unknown name.
        """
        function = find_method(method) if isinstance(method, str) else method
        if warm:
            warm_up(self.antenna, function, self.rest_image)
        return PushTracker(self.antenna, function)

    def check(self) -> CalibrationReport:
        """Return the calibration's quality, and contradictions of rest images and rig.json."""
        return calibration_report(self.antenna)


def open_rig(path: str | Path, centreline: str = "profile_fit") -> CalibratedRig:
    """Open rig.json, or its folder, with the board and rest images beside it, and calibrate.

    `centreline` is the name of an extractor. Raises InputError where files are missing or wrong.
    """
    learn, files = find_extractor(centreline), open_rig_files(Path(path))
    return CalibratedRig(set_up(files, learn), next(files.read_rest_images()))
