"""Scenes: read from a file, or written in Python."""

from pathlib import Path
from typing import Any

from vbaa_bench.assembly.plan import accepted_rig
from vbaa_bench.scene.load import SceneFile, check_scene, load_scene

AnyScene = SceneFile | Path | str


class Scene(SceneFile):
    """A scene built in Python, with the same keys as a scene file.

    Missing keys have their defaults. File names in the scene are relative to the current folder.
    `scene` holds the checked values.

    Raises InputError that lists all mistakes.

    >>> import vbaa_bench as vb
    >>> pushes = {"contact_distance_mm": [120], "deflection_pct": [5, 10]}
    >>> scene = vb.Scene(title="One push", seed=1, pushes=pushes)
    >>> scene.scene.beam.length_mm
    240.0
    >>> vb.Scene(title="One push", seed=1, pushes=pushes, beam={"lenght_mm": 100})
    Traceback (most recent call last):
    ...
    solver.instrument.errors.InputError: Scene: beam.lenght_mm is an unknown key; did you mean \
length_mm?
    """

    def __init__(self, **keys: Any) -> None:
        checked = check_scene(keys)
        super().__init__(checked.path, checked.scene, checked._document, checked._tree)


def scene_file(scene: AnyScene) -> SceneFile:
    """Read the scene if a path is given; of random rigs, draw the first. Raises InputError."""
    return accepted_rig(scene if isinstance(scene, SceneFile) else load_scene(scene))
