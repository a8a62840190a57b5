"""Load a scene from YAML 1.2. All mistakes in the file are listed, with line and column."""

import io
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import to_jsonable_python
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.files import open_regular
from vbaa_bench.scene.files import NamedFile, named_files
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.mistakes import (
    CLEARER,
    SETTINGS,
    distribution_mistakes,
    listed_mistakes,
    located_message,
)
from vbaa_bench.scene.plain import MAX_DEPTH, Plain, as_document, too_deep
from vbaa_bench.scene.random_checks import random_mistakes
from vbaa_bench.scene.random_keys import (
    DistributionError,
    Tree,
    nodes,
    parse,
    path_of,
    random_keys,
    with_random_keys,
)
from vbaa_bench.scene.random_scene import (
    RejectedDrawError,
    accepted,
    check_draws,
    drawn_values,
    rig_scene,
)
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scene.shipped import find_scene
from vbaa_bench.scene.user_modules import module_digests

# Chosen: shipped scenes are up to 3 kB. A file of the largest size takes two seconds to parse.
MAX_FILE_BYTES: Final = 100_000
_Model = TypeVar("_Model", bound=BaseModel)


@dataclass(frozen=True)
class SceneFile:
    """Scene with its source file, so that later messages can name a line.

    If keys are random per rig, `scene` is that of the first rig.
    """

    path: Path
    scene: Scene
    _document: Any = field(repr=False)
    # Values with distributions; None if no key is random.
    _tree: Tree = field(default=None, repr=False)

    # Folder of the files that the scene names; None if it is that of the scene file.
    _folder: Path | None = field(default=None, repr=False)

    @property
    def folder(self) -> Path:
        """Folder of the files that the scene names."""
        return self.path.parent if self._folder is None else self._folder

    @property
    def named_files(self) -> tuple[NamedFile, ...]:
        """Files that the scene names or may draw."""
        return named_files(self._possible, Scene)

    @property
    def user_modules(self) -> dict[str, str]:
        """Digests of the users' modules of whose kinds the scene has or may draw any, by name."""
        return module_digests(self._possible)

    @property
    def _possible(self) -> Tree:
        """Values with all distributions."""
        if self._tree is not None:
            return self._tree
        values = self.scene.model_dump(exclude={"random_keys"})
        return with_random_keys(values, self.scene.random_keys)

    @property
    def is_random(self) -> bool:
        """Whether `rig` draws values."""
        return self._tree is not None

    @property
    def rigs(self) -> int | None:
        """Number of rigs of a collection, None for a single dataset."""
        return None if self._tree is None else self._tree.get("rigs")

    @property
    def drawn_once(self) -> tuple[str, ...]:
        """Random keys that have one value for all frames of a dataset; none of a collection."""
        if self.rigs is not None:
            return ()
        return tuple(key.key for key in random_keys(self._tree) if key.per == "rig")

    @property
    def template(self) -> dict[str, Any]:
        """The values of the file with their distributions, for JSON."""
        values = self.scene.model_dump(mode="json") if self._tree is None else self._tree
        return dict(to_jsonable_python(values, by_alias=True))

    def rig_values(self, rig: Scene) -> dict[str, Any]:
        """Collect the values that were drawn for a rig, by key."""
        return drawn_values((key for key in random_keys(self._tree) if key.per == "rig"), rig)

    def rig(self, number: int, attempt: int = 0) -> "SceneFile":
        """Return the scene of one rig. Raises RejectedDrawError."""
        if self._tree is None:
            return self
        return self._changed(scene=rig_scene(self._tree, number, attempt), _tree=None)

    def with_scene(self, scene: Scene) -> "SceneFile":
        """Return the file with another scene, such as one with the values of a push."""
        return self._changed(scene=scene)

    def with_files_in(self, folder: Path) -> "SceneFile":
        """Return the file with another folder of the files that the scene names."""
        return self._changed(_folder=folder)

    def _changed(self, **changes: Any) -> "SceneFile":
        # Not by dataclasses.replace: a subclass may be built from other arguments.
        return SceneFile(**{one.name: getattr(self, one.name) for one in fields(self)} | changes)

    def message_at(self, key: Sequence[str | int], sentence: str) -> str:
        """Return `file:line:column: key: sentence` for `key`, or for the nearest key above it."""
        return located_message(self.path, self._document, key, sentence)


def load_scene(
    path: Path | str,
    seed: int | None = None,
    settings: Sequence[str] = (),
    frames: int | None = None,
) -> SceneFile:
    """Read and check a scene. Raises InputError with all mistakes.

    `path` may be the name of a shipped scene, such as "hard/taper". `seed` replaces the file's,
    and `settings`, such as "beam.length_mm=200", replace values. `frames` is the least number of
    frames; it changes the number of random pushes.
    """
    path = find_scene(path)
    document = _mapping(path)
    _with_recorded_names(path, document)
    for setting in settings:
        _set(document, setting)
    file = _checked(path, document, {} if seed is None else {"seed": seed})
    if frames is None:
        return file
    pushes, sampling = file.scene.pushes, file.scene.sampling
    key, size = ("sampling.count", sampling.count) if sampling else ("pushes.repeats", 1)
    size = pushes.repeats if pushes else size
    per_repetition = Frames(file.scene).count // size
    _set(document, f"{key}={math.ceil(frames / per_repetition)}")
    return _checked(path, document, {} if seed is None else {"seed": seed})


def read_model(path: Path, model: type[_Model]) -> _Model:
    """Read a YAML file that is no scene, and check it against a model.

    Raises InputError with all mistakes.
    """
    document = _mapping(path)
    try:
        return model.model_validate(Plain(path).of(document))
    except ValidationError as error:
        mistakes = listed_mistakes(path, document, error.errors(), model)
        raise InputError("\n".join(mistakes)) from error


def read_plain(path: Path) -> dict[str, Any]:
    """Read the mapping in a YAML file as plain values, unchecked. Raises InputError."""
    return dict(Plain(path).of(_mapping(path)))


def _mapping(path: Path) -> CommentedMap:
    document = _document(path, _text(path))
    if not isinstance(document, CommentedMap):
        raise InputError(
            f"{path}:1:1: is {quoted(document)}, allowed is a mapping of keys to values"
        )
    return document


def _with_recorded_names(path: Path, document: CommentedMap) -> None:
    """Give keys with a clearer name those of the records. Raises InputError for both at once."""
    for section, names in CLEARER.items():
        node = document.get(section)
        for clearer, name in names.items() if isinstance(node, CommentedMap) else ():
            if clearer not in node:
                continue
            if name in node:
                sentence = f"is another name of {name}, allowed is one of the two"
                raise InputError(located_message(path, document, (section, clearer), sentence))
            node.insert(list(node).index(clearer), name, node.pop(clearer))
            # A scene that is built in Python has no places.
            if node.lc.data and clearer in node.lc.data:
                node.lc.data[name] = node.lc.data.pop(clearer)


def _set(document: CommentedMap, setting: str) -> None:
    """Replace a value of a document: `beam.length_mm=200`. Raises InputError."""
    key, equals, text = setting.partition("=")
    *sections, last = key.split(".")
    last = CLEARER.get(".".join(sections), {}).get(last, last)
    if not equals or not last:
        raise InputError(f"--set is {quoted(setting)}, allowed is KEY=VALUE")
    node: Any = document
    path: list[str | int] = []
    for part in (*sections, last):
        if path:
            node = _within(node, path[-1])
        if isinstance(node, CommentedSeq) and part.isdigit() and int(part) < len(node):
            path.append(int(part))
        elif isinstance(node, CommentedMap):
            path.append(part)
        else:
            raise InputError(f"--set is {quoted(setting)}, but {part} is in no section")
    node[path[-1]] = _document(Path("--set"), text)
    stated = {**getattr(document, SETTINGS, {}), tuple(path): setting}
    setattr(document, SETTINGS, stated)


def _within(node: Any, part: str | int) -> Any:
    """Return a part of a document, which is added where it is missing."""
    return node.setdefault(part, CommentedMap()) if isinstance(node, CommentedMap) else node[part]


def check_scene(keys: Mapping[str, Any]) -> SceneFile:
    """Check a scene given as keys and values of Python, as in a file.

    Paths in it are relative to the current folder. Raises InputError with all mistakes.
    """
    path = Path("Scene")
    return _checked(path, as_document(keys, path), {})


def recorded_scene(values: Mapping[str, Any], path: Path, folder: Path) -> SceneFile:
    """Return the scene of a dataset from the values in `path`, its manifest or identity.

    `folder` contains the files that the scene names. Raises InputError.
    """
    try:
        scene = Scene.model_validate(recorded_values(values, path))
    except ValidationError as error:
        # Such as a dataset of a version in which other scenes were allowed.
        mistakes = listed_mistakes(path, as_document(values, path), error.errors())
        raise InputError("\n".join(mistakes)) from error
    return SceneFile(path, scene, CommentedMap(), _folder=folder)


def recorded_values(values: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Convert a scene from a manifest's values to what the model accepts. Raises InputError."""
    plain = Plain(path).of(as_document(values, path))
    try:
        random = tuple(
            {**key, "distribution": parse(key["distribution"], path_of(key["key"]))}
            for key in plain.get("random_keys") or ()
        )
    except (DistributionError, KeyError, TypeError, AttributeError) as error:
        message = f"{path}: random_keys are not those of a generated scene"
        raise InputError(message) from error
    return {**plain, "random_keys": random}


def _checked(path: Path, document: CommentedMap, overrides: Mapping[str, Any]) -> SceneFile:
    _with_recorded_names(path, document)
    values = Plain(path).of(document) | overrides
    if "random_keys" in values:
        message = "is an unknown key; distributions are stated in the places of values"
        raise InputError(located_message(path, document, ("random_keys",), message))
    try:
        tree = parse(values)
    except DistributionError as error:
        raise InputError("\n".join(distribution_mistakes(path, document, error))) from error
    if values.get("rigs") is None and not any(True for _ in nodes(tree)):
        return SceneFile(path, _checked_scene(path, document, values), document)
    if mistakes := random_mistakes(path, document, tree):
        raise InputError("\n".join(mistakes))
    try:
        check_draws(tree)
    except RejectedDrawError as error:
        raise InputError(located_message(path, document, error.path, str(error))) from error
    scene = accepted(lambda attempt: rig_scene(tree, 0, attempt), str(path))
    return SceneFile(path, scene, document, tree)


def _checked_scene(path: Path, document: CommentedMap, values: Mapping[str, Any]) -> Scene:
    try:
        return Scene.model_validate(values)
    except ValidationError as error:
        raise InputError("\n".join(listed_mistakes(path, document, error.errors()))) from error


def _text(path: Path) -> str:
    try:
        with open_regular(path) as stream:
            data = stream.read(MAX_FILE_BYTES + 1)
        if len(data) > MAX_FILE_BYTES:
            raise InputError(f"{path}: is too large, allowed are {MAX_FILE_BYTES:,} bytes")
        return data.decode("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text") from error


def _document(path: Path, text: str) -> Any:
    """Parse a document, with the places of its keys."""
    try:
        depth = 0
        # Events come one by one, so that the parser never recurses into a deep document.
        for event in YAML(typ="rt").parse(io.StringIO(text)):
            depth += isinstance(event, CollectionStartEvent)
            depth -= isinstance(event, CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise too_deep(path, event.start_mark.line)
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # such as an anchor that is defined twice
            return YAML(typ="rt").load(io.StringIO(text))
    except MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise InputError(f"{path}{where}: is not YAML ({truncated(str(error.problem))})") from error
    except YAMLError as error:
        raise InputError(f"{path}: is not YAML ({truncated(str(error))})") from error
    except InputError:
        raise
    except Exception as error:  # odd tags, keys and numbers raise errors of any type
        raise InputError(
            f"{path}: is not valid YAML for a scene ({truncated(str(error))})"
        ) from error
