"""The scenes and suites that come with this package."""

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


def shipped_suites() -> list[Path]:
    """List the files of all shipped suites, whose names are their versions."""
    return sorted((shipped_scenes() / SUITES).glob("*.yaml"))


def frozen_digests(suite: Path) -> Path:
    """Return the path of the frozen digests of a suite, beside its file."""
    return suite.with_suffix(".digests.json")
