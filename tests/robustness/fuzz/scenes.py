"""Fuzzed scenes: shipped scenes with mistakes, loaded, checked and planned before any image."""

import random
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML

from tests.robustness.fuzz.damage import damaged
from tests.robustness.fuzz.documents import yaml_text
from tests.robustness.fuzz.trees import mutated
from vbaa_bench.assembly.plan import accepted_rig, plan
from vbaa_bench.dataset.identity import dataset_identity
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.shipped import SUITES

# Frames of the planned pushes. Chosen: several pushes of most scenes; a frame takes up to 50 ms.
_FRAMES: Final = 12
# Share of scenes with damaged bytes; the others have mistakes in their structure.
_BYTES: Final = 0.2


class Scenes:
    """Mutates scenes and runs them up to the first image."""

    def __init__(self, material: Path) -> None:
        """Read all scenes below `material`/scenes, and the files that they name."""
        everything = sorted((material / "scenes").rglob("*.yaml"))
        paths = [path for path in everything if path.parent.name != SUITES]
        self.texts = [path.read_text(encoding="utf-8") for path in paths]
        self.trees = [YAML(typ="safe", pure=True).load(text) for text in self.texts]
        self._files = {path.name: path.read_bytes() for path in (material / "files").iterdir()}

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Write a scene with mistakes, load it, and plan a few of its pushes."""
        path = folder / "scene.yaml"
        path.write_bytes(self._data(chance))
        self.write_files(folder, path.read_bytes())
        use_scene(load_scene(path), chance)

    def write_files(self, folder: Path, scene: bytes) -> None:
        """Write the valid files that a scene names beside it."""
        for name, data in self._files.items():
            if name.encode() in scene:
                (folder / name).write_bytes(data)

    def _data(self, chance: random.Random) -> bytes:
        if chance.random() < _BYTES:
            return damaged(chance.choice(self.texts).encode(), chance)
        return yaml_text(self.tree(chance), chance).encode("utf-8", errors="surrogatepass")

    def tree(self, chance: random.Random) -> Any:
        """Return the values of a scene with mistakes."""
        return mutated(chance.choice(self.trees), chance, self.trees)


def use_scene(file: SceneFile, chance: random.Random) -> None:
    """Do what `generate` does with a scene before the first image, with a few pushes."""
    rig = accepted_rig(file)
    dataset_identity(rig, "scalar_rgb")
    frames = Frames(rig.scene)
    number = min(frames.pushes, max(_FRAMES * frames.pushes // frames.count, 1))
    plan(rig, pushes={0, *(chance.randrange(frames.pushes) for _ in range(number - 1))})
