"""Files that a scene names: meshes, images of surfaces, environment maps.

The keys of files are marked in the models of a scene. Files are found by one walk of the scene's
values, of which some may be distributions: every file that may be drawn is named.
"""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Final, Literal, NamedTuple, Protocol

from pydantic import BaseModel, Field
from pydantic.fields import FieldInfo

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.hashes import HASHES
from vbaa_bench.scene.distributions import Choice, From
from vbaa_bench.scene.families import marks, narrowed, sections
from vbaa_bench.scene.part import KeyPath

# Longest name, with folders. Chosen: file names can have 255 characters.
MAX_NAME_LENGTH: Final = 250
Kind = Literal["mesh", "image", "environment"]
# Largest files [bytes], by kind. Derived: the largest number of faces in the most verbose format
# of meshes; the largest allowed image, 8192 x 8192 px, uncompressed, in single precision and with
# four channels.
MAX_BYTES: Final[Mapping[Kind, int]] = {
    "mesh": 100_000_000,
    "image": 1 << 30,
    "environment": 1 << 30,
}


class NamesFile(NamedTuple):
    """Mark of the type of a key that names a file of this kind."""

    kind: Kind


# Types of such keys.
MeshName = Annotated[str, Field(min_length=1), NamesFile("mesh")]
ImageName = Annotated[str, Field(min_length=1), NamesFile("image")]
EnvironmentName = Annotated[str, Field(min_length=1), NamesFile("environment")]


class SceneFileError(InputError):
    """Error for a file that a scene names: missing, unusable, or not the one that was recorded.

    It is never a property of a draw: no other values are drawn in place of those that name the
    file, and no frame is left out.
    """


class NamedFile(NamedTuple):
    """A file that a scene names at `key`, and what it must be."""

    key: KeyPath
    name: str
    kind: Kind


class ImageFiles(Protocol):
    """Reader of the images that a scene names. Its methods raise SceneFileError."""

    def environment(self, name: str) -> Floats:
        """Read the radiances (height, width) of a map of the surroundings."""

    def image(self, name: str) -> Floats:
        """Read the values (height, width) of an image, whose mean is 1."""


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


def named_files(tree: Any, model: type[BaseModel]) -> tuple[NamedFile, ...]:
    """List the files that the values of a model name or may draw, each once per kind.

    Distributions may take the place of values (vbaa_bench/scene/random_keys.py).
    """
    files: dict[tuple[str, Kind], NamedFile] = {}
    for leaf in leaves(tree, model):
        kind = next((kind for field in leaf.fields if (kind := _kind_of_file(field))), None)
        if kind is not None and isinstance(leaf.value, str):
            files.setdefault((leaf.value, kind), NamedFile(leaf.key, leaf.value, kind))
    return tuple(files.values())


def _kind_of_file(field: FieldInfo) -> Kind | None:
    """Return the kind of file that a key names, None if it names none."""
    return next((mark.kind for mark in marks(field) if isinstance(mark, NamesFile)), None)


def name_of(key: KeyPath) -> str:
    """Return the name of a key in its section, also for an item of a list."""
    return next(part for part in reversed(key) if isinstance(part, str))


class Leaf(NamedTuple):
    """A plain value that a scene has or may draw, its key, and the models of its section."""

    key: KeyPath
    value: Any
    models: Sequence[type[BaseModel]]

    @property
    def fields(self) -> list[FieldInfo]:
        """The fields that allow the value."""
        return _fields(self.models, self.key)


def leaves(tree: Mapping[str, Any], model: type[BaseModel]) -> Iterator[Leaf]:
    """Yield every plain value that the values of a model have or may have.

    Where the kind of a section is not stated, or random, the models are those of all kinds.
    """
    for name, part in tree.items():
        yield from _Walk(tree).leaves(part, (name,), [model])


def _fields(models: Sequence[type[BaseModel]], key: KeyPath) -> list[FieldInfo]:
    """List the fields of a key, which may be that of an item of a list, in some models."""
    name = name_of(key)
    return [model.model_fields[name] for model in models if name in model.model_fields]


class _Walk:
    """Walk of a tree of values that follows every option of its distributions."""

    def __init__(self, tree: Any) -> None:
        self._tree = tree
        # Keys that values are computed from, which may be computed from each other in some draws.
        self._followed: set[str] = set()

    def leaves(self, node: Any, key: KeyPath, models: Sequence[type[BaseModel]]) -> Iterator[Leaf]:
        """Yield every plain value that a part of a section of these models has or may have."""
        for value in self._options(node):
            if isinstance(value, Mapping):
                inner = [model for field in _fields(models, key) for model in sections(field)]
                for name, part in value.items():
                    yield from self.leaves(part, (*key, name), narrowed(inner, value))
            elif isinstance(value, tuple):
                for number, part in enumerate(value):
                    yield from self.leaves(part, (*key, number), models)
            else:
                yield Leaf(key, value, models)

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
