"""Scenes and suites of this package: scenes by name, such as `quickstart` or `hard/taper`."""

import difflib
import re
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError, truncated

# Folder of the suites, which are no scenes.
SUITES: Final = "suites"


class ShippedScene(NamedTuple):
    """A scene of this package: its name, a sentence on what it shows, and its file."""

    name: str
    shows: str
    path: Path

    @property
    def folder(self) -> str:
        """Folder of the scene among those of this package, "" at the top."""
        return self.name.rpartition("/")[0]


def shipped_scenes() -> Path:
    """Return the folder of the scenes: in the installed package, or beside it in a checkout."""
    package = Path(__file__).parents[1]
    installed = package / "scenes"
    return installed if installed.is_dir() else package.parent / "scenes"


def shipped_scene_files() -> list[Path]:
    """List the files of all shipped scenes."""
    folder = shipped_scenes()
    return [path for path in sorted(folder.rglob("*.yaml")) if path.parent != folder / SUITES]


def shipped_suites() -> list[Path]:
    """List the files of all shipped suites, whose names are their versions."""
    return sorted((shipped_scenes() / SUITES).glob("*.yaml"))


def frozen_frames(suite: Path) -> Path:
    """Return the path of the fingerprints of a suite's frames, beside its file."""
    return suite.with_suffix(".frozen.json")


def list_scenes() -> list[ShippedScene]:
    """List the shipped scenes, by folder and name; scenes of the paper's rig come first.

    >>> import vbaa_bench as vb
    >>> [scene.shows for scene in vb.list_scenes() if scene.name == "hard/taper"]
    ['Assumption 5 violated: the beam tapers to 60 % of its diameter at the tip.']
    """
    scenes = [
        ShippedScene(name, _first_sentence(path.read_text(encoding="utf-8")), path)
        for name, path in _paths().items()
    ]
    return sorted(scenes, key=lambda scene: (scene.folder, scene.name))


def find_scene(name: Path | str) -> Path:
    """Find the file of a scene, whose path is given, or the name of a shipped scene.

    A file wins. Raises InputError if there is neither.
    """
    path = Path(name)
    try:
        if path.exists() and not path.is_dir():
            return path
        shipped = _paths()
        if path.as_posix() in shipped:
            return shipped[path.as_posix()]
        if path.exists():
            return path
    except OSError as error:
        raise InputError(f"{path}: is not a file name ({error.strerror})") from error
    word = truncated(path.as_posix().removeprefix("scenes/").removesuffix(".yaml"))
    # A name without its folder is understood as well: taper, hard/taper.
    known = {name.rpartition("/")[2]: name for name in shipped} | {name: name for name in shipped}
    similar = difflib.get_close_matches(word, known, n=1, cutoff=0.7)
    hint = f"did you mean {known[similar[0]]}?" if similar else "`vbaa-bench scenes` lists them"
    raise InputError(f"{truncated(str(path))}: is neither a file nor a shipped scene; {hint}")


def _paths() -> dict[str, Path]:
    """Return the files of the shipped scenes by name."""
    folder = shipped_scenes()
    return {
        path.relative_to(folder).with_suffix("").as_posix(): path for path in shipped_scene_files()
    }


def _first_sentence(text: str) -> str:
    """Return the first sentence of the comment at the head of a file."""
    comment = re.match(r"(?:# .*\n)*", text)
    words = " ".join(comment[0].replace("\n# ", " ").removeprefix("# ").split()) if comment else ""
    return re.split(r"(?<=\.) (?=[A-Z])", words)[0]
