"""Files that a scene names: meshes, images of surfaces, environment maps.

They are found by one walk of the scene's values, of which some may be distributions: every file
that may be drawn is named.
"""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import Field

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.hashes import HASHES
from vbaa_bench.scene.distributions import Choice, From

# Longest name, with folders. Chosen: file names can have 255 characters.
MAX_NAME_LENGTH: Final = 250
Kind = Literal["mesh", "image", "environment"]
Key = tuple[str | int, ...]
# Last two names of a key of a scene that names a file, without the numbers of lists.
KEYS: Final[Mapping[tuple[str, ...], Kind]] = {
    ("object", "file"): "mesh",
    ("texture", "file"): "image",
    ("background", "image_file"): "image",
    ("lights", "file"): "environment",
}
# Largest files [bytes], by kind. Derived: the largest number of faces in the most verbose format
# of meshes; the largest allowed image, 8192 x 8192 px, uncompressed, in single precision and with
# four channels.
MAX_BYTES: Final[Mapping[Kind, int]] = {
    "mesh": 100_000_000,
    "image": 1 << 30,
    "environment": 1 << 30,
}


class _NamesFile:
    """Mark of a key of a scene that names a file."""


NAMES_FILE: Final = _NamesFile()
# Type of such a key.
FileName = Annotated[str, Field(min_length=1), NAMES_FILE]


class SceneFileError(InputError):
    """Error for a file that a scene names: missing, unusable, or not the one that was recorded.

    It is never a property of a draw: no other values are drawn in place of those that name the
    file, and no frame is left out.
    """


class NamedFile(NamedTuple):
    """A file that a scene names at `key`, and what it must be."""

    key: Key
    name: str
    kind: Kind


class FileContent(NamedTuple):
    """The bytes of a file that a scene names; `path` is for messages."""

    path: Path
    data: bytes


@contextlib.contextmanager
def unusable_file() -> Iterator[None]:
    """Turn an InputError, raised while a scene's file is decoded, into a SceneFileError."""
    try:
        yield
    except SceneFileError:
        raise
    except InputError as error:
        raise SceneFileError(str(error)) from error


def named_files(tree: Any) -> tuple[NamedFile, ...]:
    """List the files that a scene's tree of values names or may draw, each once per kind.

    Distributions may take the place of values (vbaa_bench/scene/random_keys.py).
    """
    found: dict[tuple[str, Kind], NamedFile] = {}
    for key, value in _Walk(tree).leaves(tree, ()):
        kind = KEYS.get(tuple(part for part in key if isinstance(part, str))[-2:])
        if kind is not None and isinstance(value, str):
            found.setdefault((value, kind), NamedFile(key, value, kind))
    return tuple(found.values())


class _Walk:
    """Walk of a tree of values that follows every option of its distributions."""

    def __init__(self, tree: Any) -> None:
        self._tree = tree
        # Keys that values are computed from, which may be computed from each other in some draws.
        self._followed: set[str] = set()

    def leaves(self, node: Any, key: Key) -> Iterator[tuple[Key, Any]]:
        """Yield every plain value that a part of the tree has or may have, with its key."""
        for value in self._options(node):
            if isinstance(value, Mapping):
                for name, part in value.items():
                    yield from self.leaves(part, (*key, name))
            elif isinstance(value, tuple):
                for number, part in enumerate(value):
                    yield from self.leaves(part, (*key, number))
            else:
                yield key, value

    def _options(self, node: Any) -> Iterator[Any]:
        """Yield the values that may be drawn for a node; a value that is not random is its own."""
        if isinstance(node, Choice):
            for option in node.choice:
                yield from self._options(option)
        elif isinstance(node, From):
            if node.source not in self._followed:
                self._followed.add(node.source)
                yield from self._at(self._tree, node.source.split("."))
                self._followed.discard(node.source)
        else:
            yield node

    def _at(self, node: Any, key: Sequence[str]) -> Iterator[Any]:
        """Yield the values that may be drawn for a key; none if it is not in the tree."""
        for value in self._options(node):
            if not key:
                yield value
            elif isinstance(value, Mapping) and key[0] in value:
                yield from self._at(value[key[0]], key[1:])
            elif isinstance(value, tuple) and key[0].isdigit() and int(key[0]) < len(value):
                yield from self._at(value[int(key[0])], key[1:])


def file_of_scene(folder: Path, name: str) -> Path:
    """Return the path of a file that a scene names, which must be within the scene's folder.

    Subfolders are allowed; absolute paths, `..` and links that lead out of it are not: a scene
    from elsewhere must not copy other files of this machine into a dataset.

    Raises SceneFileError.
    """
    if len(name) > MAX_NAME_LENGTH:
        raise SceneFileError(
            f"{truncated(name)}: has {len(name)} characters, allowed are {MAX_NAME_LENGTH}"
        )
    path = folder / name
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError) as error:  # an invalid name, or a loop of links
        raise SceneFileError(f"{folder}: {quoted(name)} is not a file name") from error
    # As a name in a dataset, it must be the same from any folder.
    parts = PurePosixPath(name).parts
    if not inside or ".." in parts or Path(name).is_absolute():
        raise SceneFileError(
            f"{name}: is outside of the scene's folder {folder}, allowed is a file within it"
        )
    if not name.isprintable() or not parts or parts[-1] == HASHES:
        raise SceneFileError(f"{folder}: {quoted(name)} is not a file name that a scene may use")
    return path


def name_in_dataset(name: str) -> str:
    """Return the name that a file has in a dataset, whose tables of hashes allow no `./a.stl`."""
    return PurePosixPath(name).as_posix()
