"""Load a scene from YAML 1.2. All mistakes in the file are listed, with line and column."""

import difflib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, get_args

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent

from solver.instrument.errors import InputError, quoted, truncated
from vbaa_bench.scene.renamed import new_key
from vbaa_bench.scene.schema import Scene

Key = str | int

# Chosen: shipped scenes are up to 3 kB and four levels deep and have 100 values. A file of the
# largest size takes two seconds to parse.
MAX_FILE_BYTES: Final = 100_000
MAX_DEPTH: Final = 20
MAX_VALUES: Final = 10_000
# Chosen: the length of a list of mistakes that a terminal shows.
MAX_MISTAKES: Final = 20


@dataclass(frozen=True)
class SceneFile:
    """Scene with its source file, so that later messages can name a line."""

    path: Path
    scene: Scene
    _document: Any = field(repr=False)

    def message_at(self, key: Sequence[Key], sentence: str) -> str:
        """Return `file:line:column: key: sentence` for `key`, or for the nearest key above it."""
        return _located_message(self.path, self._document, key, sentence)


def load_scene(path: Path | str, seed: int | None = None) -> SceneFile:
    """Read and check a scene; `seed` replaces the file's. Raises InputError with all mistakes."""
    path = Path(path)
    document = _document(path, _text(path))
    if not isinstance(document, CommentedMap):
        raise InputError(
            f"{path}:1:1: is {quoted(document)}, allowed is a mapping of keys to values"
        )
    return _checked(path, document, {} if seed is None else {"seed": seed})


def check_scene(keys: Mapping[str, Any]) -> SceneFile:
    """Check a scene given as keys and values of Python, as in a file.

    Paths in it are relative to the current folder. Raises InputError with all mistakes.
    """
    return _checked(Path("Scene"), _as_document(keys), {})


def _as_document(value: Any) -> Any:
    """Convert mappings and sequences to the parser's types, without places in a file."""
    if isinstance(value, Mapping):
        return CommentedMap({key: _as_document(part) for key, part in value.items()})
    if isinstance(value, list | tuple):
        return CommentedSeq([_as_document(part) for part in value])
    return value


def _checked(path: Path, document: CommentedMap, overrides: Mapping[str, Any]) -> SceneFile:
    values = _Plain(path).of(document) | overrides
    try:
        scene = Scene.model_validate(values)
    except ValidationError as error:
        raise InputError("\n".join(_mistakes(path, document, error))) from error
    return SceneFile(path, scene, document)


def _text(path: Path) -> str:
    try:
        # A pipe or a device may never end; a folder raises its own error.
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError(f"{path}: cannot be read (it is not a file)")
        with path.open("rb") as stream:
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
                raise _too_deep(path, event.start_mark.line)
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


def _too_deep(path: Path, line: int = 0) -> InputError:
    return InputError(f"{path}:{line + 1}:1: is nested too deeply, allowed are {MAX_DEPTH} levels")


def _mistakes(path: Path, document: Any, error: ValidationError) -> list[str]:
    sentences_by_key: dict[tuple[Key, ...], list[str]] = {}
    for mistake in error.errors():
        key, sentence = _mistake(document, mistake)
        sentences = sentences_by_key.setdefault(key, [])
        # A value with two allowed types has an error for each.
        alternative = sentences and sentence.rpartition(", allowed is ")
        sentences.append(alternative[2] if alternative else sentence)
    # A list whose values have errors is not reported itself.
    keys = [
        key
        for key in sentences_by_key
        if not any(key == longer_key[: len(key)] != longer_key for longer_key in sentences_by_key)
    ]
    lines = [
        _located_message(path, document, key, " or ".join(sentences_by_key[key])) for key in keys
    ]
    if len(lines) > MAX_MISTAKES:
        rest = f"{path}: and {len(lines) - MAX_MISTAKES} more mistakes"
        return [*lines[:MAX_MISTAKES], rest]
    return lines


def _mistake(document: Any, mistake: Any) -> tuple[tuple[Key, ...], str]:
    """Return the key of one of pydantic's errors, as in the file, and a sentence."""
    kind, value, context = mistake["type"], mistake["input"], mistake.get("ctx", {})
    key = _key_in_file(document, mistake["loc"], missing=kind == "missing")
    match kind:
        case "missing":
            return key, "is missing"
        case "extra_forbidden":
            return key, f"is an unknown key; {_hint(key, mistake['loc'])}"
        case "union_tag_invalid" | "union_tag_not_found":
            state = "missing" if kind == "union_tag_not_found" else quoted(value["kind"])
            allowed = ", ".join(map(_kind, _models(mistake["loc"])))
            return (*key, "kind"), f"is {state}, allowed is one of {allowed}"
        case "value_error":
            return key, str(context["error"])
        case "literal_error":
            allowed = f"one of {context['expected']}".replace("'", "").replace(" or ", ", ")
        case "too_short":
            allowed = f"a list of at least {context['min_length']}"
        case "string_too_short":
            allowed = f"a text of at least {context['min_length']} character"
        case "too_long":
            allowed = f"a list of at most {context['max_length']}"
        case _:
            allowed = mistake["msg"].removeprefix("Input should be ").replace("a valid ", "a ")
            allowed = allowed.replace("integer", "whole number")
    plain_value = list(value) if isinstance(value, tuple) else value
    return key, f"is {quoted(plain_value)}, allowed is {allowed}"


def _hint(key: Sequence[Key], location: Sequence[Key]) -> str:
    """Suggest the key that is meant by an unknown one, or list those of its section."""
    name = str(key[-1])
    section = next((str(part) for part in key[:-1] if isinstance(part, str)), "")
    if renamed := new_key(section, name):
        return f"it is now called {renamed}"
    known = list(_models(location[:-1])[0].model_fields)
    similar = difflib.get_close_matches(truncated(name), known, n=1, cutoff=0.7)
    return f"did you mean {similar[0]}?" if similar else f"known are {', '.join(known)}"


def _key_in_file(document: Any, location: Sequence[Key], *, missing: bool) -> tuple[Key, ...]:
    """Return the key as in the file, without the model's own intermediate steps."""
    key: list[Key] = []
    node = document
    for number, part in enumerate(location):
        is_key = isinstance(node, CommentedMap) and part in node
        is_index = isinstance(node, CommentedSeq) and isinstance(part, int) and part < len(node)
        if is_key or is_index:
            key.append(part)
            node = node[part]
        elif missing and number == len(location) - 1:
            key.append(part)
    return tuple(key)


def _models(location: Sequence[Key]) -> list[type[BaseModel]]:
    """List the sections that are allowed at a location of pydantic's, which names their `kind`."""
    models: list[type[BaseModel]] = [Scene]
    for part in location:
        if isinstance(part, int):
            continue
        matching = [m for m in models if len(models) > 1 and _kind(m) == part]
        models = matching or _sections(models[0].model_fields[part].annotation)
    return models


def _kind(model: type[BaseModel]) -> str:
    return str(get_args(model.model_fields["kind"].annotation)[0])


def _sections(annotation: Any) -> list[type[BaseModel]]:
    """List the sections that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for option in get_args(annotation) for model in _sections(option)]


def _located_message(path: Path, document: Any, key: Sequence[Key], sentence: str) -> str:
    line, column = 0, 0
    node = document
    for part in key:
        try:
            if isinstance(node, CommentedMap) and part in node:
                line, column = node.lc.key(part)
            elif isinstance(node, CommentedSeq) and isinstance(part, int) and part < len(node):
                line, column = node.lc.item(part)
            else:
                break
            node = node[part]
        except (KeyError, TypeError):  # the parser recorded no place
            break
    name = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key)
    label = f"{truncated(name.lstrip('.'))} " if name else ""
    # A scene that is built in Python has no lines.
    place = f":{line + 1}:{column + 1}" if document.lc.line is not None else ""
    return f"{path}{place}: {label}{sentence}"


class _Plain:
    """Converter of a parsed document to plain Python, with tuples for lists as in the models.

    An alias counts each time it is used: a few lines of aliases of aliases make millions of
    values. Raises InputError.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._values = path, 0

    def of(self, node: Any, depth: int = 1) -> Any:
        """Convert a part of the document, `depth` levels down."""
        self._values += 1
        if self._values > MAX_VALUES:
            raise InputError(f"{self._path}: holds too many values, allowed are {MAX_VALUES:,}")
        if depth > MAX_DEPTH:  # an alias within itself
            raise _too_deep(self._path)
        if isinstance(node, CommentedMap):
            return {key: self.of(value, depth + 1) for key, value in node.items()}
        if isinstance(node, CommentedSeq):
            return tuple(self.of(value, depth + 1) for value in node)
        if isinstance(node, bool) or node is None:
            return node
        for plain_type in (int, float, str):
            if isinstance(node, plain_type):
                return plain_type(node)
        return node
