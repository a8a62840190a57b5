"""Estimate contact distance, force and their covariance from images of a bending beam.

>>> import solver
>>> rig = solver.open_rig("rig")  # doctest: +SKIP
>>> tracker = rig.tracker("exact_fit")  # doctest: +SKIP
>>> estimate = tracker.update(image, motor_angle_deg=3.2)  # doctest: +SKIP
>>> estimate.x_c_mm, estimate.force_n, estimate.sigma("x_c_mm")  # doctest: +SKIP
"""

import importlib
import os
from typing import TYPE_CHECKING, Any

from solver.instrument import MAX_PIXELS

if TYPE_CHECKING:
    from solver.api import CalibratedRig, load_rig, open_rig
    from solver.beams.beam import Prior
    from solver.beams.own_beam import OwnBeam
    from solver.instrument.centreline import Centreline
    from solver.instrument.errors import InputError
    from solver.instrument.estimate import Assumption, Estimate, Outcome
    from solver.instrument.image_frame import Carriage
    from solver.instrument.measurement import Measurement
    from solver.instrument.observation import open_observations
    from solver.methods import METHODS
    from solver.methods.exact_fit import exact_fit
    from solver.methods.push_fit import push_fit, push_fit_friction
    from solver.tracing.beam_fit import TracedBeam
    from solver.tracing.traced import trace
    from solver.tracker import PushTracker

__all__ = [
    "METHODS",
    "Assumption",
    "CalibratedRig",
    "Carriage",
    "Centreline",
    "Estimate",
    "InputError",
    "Measurement",
    "Outcome",
    "OwnBeam",
    "Prior",
    "PushTracker",
    "TracedBeam",
    "exact_fit",
    "load_rig",
    "open_observations",
    "open_rig",
    "push_fit",
    "push_fit_friction",
    "trace",
]

# OpenCV compares an image's size with this before it allocates memory for its pixels, in all
# formats. It reads the variable once, when it is imported: this package is imported before.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))

# Imported when first used: numba and SciPy take a second.
_MODULE_OF = {
    "METHODS": "methods",
    "Assumption": "instrument.estimate",
    "CalibratedRig": "api",
    "Carriage": "instrument.image_frame",
    "Centreline": "instrument.centreline",
    "Estimate": "instrument.estimate",
    "InputError": "instrument.errors",
    "Measurement": "instrument.measurement",
    "Outcome": "instrument.estimate",
    "OwnBeam": "beams.own_beam",
    "Prior": "beams.beam",
    "PushTracker": "tracker",
    "TracedBeam": "tracing.beam_fit",
    "open_observations": "instrument.observation",
    "open_rig": "api",
    "exact_fit": "methods.exact_fit",
    "load_rig": "api",
    "push_fit": "methods.push_fit",
    "push_fit_friction": "methods.push_fit",
    "trace": "tracing.traced",
}


# Hidden from type checkers, which would take any name as public.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Import a public name when it is first used."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module 'solver' has no attribute {name!r}")
        return getattr(importlib.import_module(f"solver.{_MODULE_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
