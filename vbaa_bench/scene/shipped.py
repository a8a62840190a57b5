"""The scenes that come with this package."""

from pathlib import Path
from typing import Final

# Folder of the suites, which are no scenes.
SUITES: Final = "suites"


def shipped_scenes() -> Path:
    """Return the folder of the shipped scenes."""
    return Path(__file__).parents[2] / "scenes"


def shipped_scene_files() -> list[Path]:
    """List the files of all shipped scenes."""
    root = shipped_scenes()
    return [path for path in sorted(root.rglob("*.yaml")) if path.parent != root / SUITES]
