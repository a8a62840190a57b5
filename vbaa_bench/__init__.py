"""Synthetic benchmark of a vision-based active antenna: generate datasets, score methods.

This module is the public interface, and `vbaa_bench.kinds` that for lights and objects of your own;
all other modules are private and may change.

>>> import vbaa_bench as vb
>>> camera = {"width_px": 256, "height_px": 88, "focal_length_px": 350}
>>> camera |= {"position_mm": [120, 22, 360], "look_at_mm": [120, 22, 0]}
>>> board = {"columns": 20, "rows": 5, "square_mm": 10, "center_mm": [120, 22], "views": 4}
>>> pushes = {"contact_distance_mm": [120], "deflection_pct": [5, 10]}
>>> scene = vb.Scene(title="One push", seed=1, pushes=pushes, camera=camera, calibration=board)
>>> data = vb.generate(scene, "runs/one_push", workers=1)
>>> [round(x_c, 1) for x_c in sorted(data.truth.frames["x_c_mm"])]
[119.6, 119.9]
>>> scores = vb.score(data, methods=["exact_fit"])
>>> scores.table()["method", "n"].rows()
[('exact_fit', 2)]
"""

import importlib
from typing import TYPE_CHECKING, Any, Final

# Imported before OpenCV, for the limit of the images that OpenCV decodes.
import solver.instrument  # noqa: F401
from vbaa_bench.extra import remedy

if TYPE_CHECKING:
    from solver.instrument.errors import InputError
    from vbaa_bench.api.comparison import compare, save_baseline
    from vbaa_bench.api.data import Collection, Dataset, generate, generate_rigs, read_exr
    from vbaa_bench.api.export import export, subset, write_croissant
    from vbaa_bench.api.forecast import Forecast, forecast
    from vbaa_bench.api.frame import Frame, render_frame
    from vbaa_bench.api.limits import LimitMaps, map_limits, store_limits
    from vbaa_bench.api.preview import preview
    from vbaa_bench.api.results import AccuracyTable, Scores, score, solve, table
    from vbaa_bench.api.scene import Scene
    from vbaa_bench.api.torch_data import torch_dataset
    from vbaa_bench.api.verification import Verification, verify
    from vbaa_bench.api.views import View, view, write_report
    from vbaa_bench.dataset.readers import open_truth
    from vbaa_bench.scene.load import load_scene
    from vbaa_bench.scene.shipped import list_scenes
    from vbaa_bench.scene.user_modules import use_module

__all__ = [
    "AccuracyTable",
    "Collection",
    "Dataset",
    "Forecast",
    "Frame",
    "InputError",
    "LimitMaps",
    "Scene",
    "Scores",
    "Verification",
    "View",
    "compare",
    "export",
    "forecast",
    "generate",
    "generate_rigs",
    "list_scenes",
    "load_scene",
    "map_limits",
    "open_truth",
    "preview",
    "read_exr",
    "render_frame",
    "save_baseline",
    "score",
    "solve",
    "store_limits",
    "subset",
    "table",
    "torch_dataset",
    "use_module",
    "verify",
    "view",
    "write_croissant",
    "write_report",
]

# Imported at first use: renderer, compiler and tables take seconds to import.
_MODULES: Final = {
    "AccuracyTable": "vbaa_bench.api.results",
    "Collection": "vbaa_bench.api.data",
    "Dataset": "vbaa_bench.api.data",
    "Forecast": "vbaa_bench.api.forecast",
    "Frame": "vbaa_bench.api.frame",
    "InputError": "solver.instrument.errors",
    "LimitMaps": "vbaa_bench.api.limits",
    "Scene": "vbaa_bench.api.scene",
    "Scores": "vbaa_bench.api.results",
    "Verification": "vbaa_bench.api.verification",
    "View": "vbaa_bench.api.views",
    "compare": "vbaa_bench.api.comparison",
    "export": "vbaa_bench.api.export",
    "forecast": "vbaa_bench.api.forecast",
    "generate": "vbaa_bench.api.data",
    "generate_rigs": "vbaa_bench.api.data",
    "list_scenes": "vbaa_bench.scene.shipped",
    "load_scene": "vbaa_bench.scene.load",
    "map_limits": "vbaa_bench.api.limits",
    "open_truth": "vbaa_bench.dataset.readers",
    "preview": "vbaa_bench.api.preview",
    "read_exr": "vbaa_bench.api.data",
    "render_frame": "vbaa_bench.api.frame",
    "save_baseline": "vbaa_bench.api.comparison",
    "score": "vbaa_bench.api.results",
    "solve": "vbaa_bench.api.results",
    "store_limits": "vbaa_bench.api.limits",
    "subset": "vbaa_bench.api.export",
    "table": "vbaa_bench.api.results",
    "torch_dataset": "vbaa_bench.api.torch_data",
    "use_module": "vbaa_bench.scene.user_modules",
    "verify": "vbaa_bench.api.verification",
    "view": "vbaa_bench.api.views",
    "write_croissant": "vbaa_bench.api.export",
    "write_report": "vbaa_bench.api.views",
}


# Hidden from type checkers, which would take any name as public.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Import a public name when it is first used."""
        if name not in _MODULES:
            raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
        try:
            value = getattr(importlib.import_module(_MODULES[name]), name)
        except ModuleNotFoundError as error:
            if (sentence := remedy(error)) is None:
                raise
            raise ModuleNotFoundError(sentence, name=error.name) from error
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
