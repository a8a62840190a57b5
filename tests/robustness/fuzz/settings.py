"""Fuzzed values of the option --set."""

import random
from pathlib import Path
from typing import Any, Final

from tests.robustness.fuzz.documents import FRAGMENTS
from tests.robustness.fuzz.scenes import Scenes
from tests.robustness.fuzz.trees import VALUES
from vbaa_bench.scene.load import load_scene

_ODD_KEYS: Final = (
    *("", ".", "..", "a.b.c", "0", "rigs", "seed.x", "random_keys", "pushes.", "\x1b[1m"),
)


class Settings:
    """Loads a shipped scene with odd settings."""

    def __init__(self, material: Path) -> None:
        """Read the scenes of `material`."""
        self._scenes = Scenes(material)

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Write a shipped scene, and load it with one to three settings."""
        number = chance.randrange(len(self._scenes.texts))
        text = self._scenes.texts[number]
        path = folder / "scene.yaml"
        path.write_text(text, encoding="utf-8")
        self._scenes.write_files(folder, text.encode())
        settings = [
            self._setting(chance, self._scenes.trees[number]) for _ in range(chance.randint(1, 3))
        ]
        frames = chance.choice((None, None, None, 1, 7, 10**6, 10**9, 10**15))
        load_scene(path, chance.choice((None, 0, 2**62, 2**70)), settings, frames)

    def _setting(self, chance: random.Random, tree: Any) -> str:
        donor = chance.choice((tree, chance.choice(self._scenes.trees)))
        key = chance.choice((_key(donor, chance), _key(donor, chance), chance.choice(_ODD_KEYS)))
        value = chance.choice((*map(str, VALUES), *FRAGMENTS))
        return chance.choice((f"{key}={value}", f"{key}={value}", f"{key}", f"{key}=={value}"))


def _key(tree: Any, chance: random.Random) -> str:
    """Choose the dotted key of a value of a scene."""
    parts: list[str] = []
    while isinstance(tree, dict | list) and tree and (not parts or chance.random() < 0.8):
        part = chance.choice(list(tree) if isinstance(tree, dict) else range(len(tree)))
        parts.append(str(part))
        tree = tree[part]
    return ".".join(parts)
