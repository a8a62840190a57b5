"""Open a rig for Python programs: calibrate once, then estimate frame by frame."""

from dataclasses import dataclass
from pathlib import Path

from solver.antenna import Antenna
from solver.centreline.extractors import EXTRACTORS
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.observation import open_rig as open_rig_files
from solver.lab.check import Checked, checked
from solver.lab.live import warm_up
from solver.methods import METHODS, Method
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
        if isinstance(method, str):
            if method not in METHODS:
                raise InputError(
                    f"method '{method}' is unknown, allowed is one of {', '.join(METHODS)}"
                )
            method = METHODS[method]
        if warm:
            warm_up(self.antenna, method, self.rest_image)
        return PushTracker(self.antenna, method)

    def check(self) -> Checked:
        """Return the calibration's quality, and contradictions of rest images and rig.json."""
        return checked(self.antenna)


def open_rig(path: str | Path, centreline: str = "profile_fit") -> CalibratedRig:
    """Open rig.json, or its folder, with the board and rest images beside it, and calibrate.

    `centreline` is the name of an extractor. Raises InputError where files are missing or wrong.
    """
    if centreline not in EXTRACTORS:
        raise InputError(
            f"centreline '{centreline}' is unknown, allowed is one of {', '.join(EXTRACTORS)}"
        )
    files = open_rig_files(Path(path))
    return CalibratedRig(set_up(files, EXTRACTORS[centreline]), next(files.read_rest_images()))
