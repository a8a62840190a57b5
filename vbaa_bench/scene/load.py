"""Load a scene from YAML 1.2. All mistakes in the file are listed at once, with their places."""

import difflib
import functools
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

from solver.instrument.errors import InputError, cut, shown
from vbaa_bench.scene.schema import Scene

Key = str | int

# Chosen: shipped scenes are up to 3 kB and four levels deep and have 100 values. A file of the
# largest size takes two seconds to parse.
LARGEST_FILE: Final = 100_000
DEEPEST: Final = 20
MOST_VALUES: Final = 10_000
# Chosen: the length of a list of mistakes that a terminal shows.
MOST_MISTAKES: Final = 20


@dataclass(frozen=True)
class SceneFile:
    """Scene with its source file, so that later messages can name a line."""

    path: Path
    scene: Scene
    _document: Any = field(repr=False)

    def complaint(self, key: Sequence[Key], sentence: str) -> str:
        """Return `file:line:column: key: sentence` for `key`, or for the nearest key above it."""
        return _complaint(self.path, self._document, key, sentence)


def load_scene(path: Path | str, seed: int | None = None) -> SceneFile:
    """Read and check a scene; `seed` replaces the file's. Raises InputError with all mistakes."""
    path = Path(path)
    document = _document(path, _text(path))
    if not isinstance(document, CommentedMap):
        raise InputError(
            f"{path}:1:1: is {shown(document)}, allowed is a mapping of keys to values"
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


def _checked(path: Path, document: CommentedMap, replaced: Mapping[str, Any]) -> SceneFile:
    plain = _Plain(path).of(document) | replaced
    try:
        scene = Scene.model_validate(plain)
    except ValidationError as error:
        raise InputError("\n".join(_mistakes(path, document, error))) from error
    return SceneFile(path, scene, document)


def _text(path: Path) -> str:
    try:
        # A pipe or a device may never end; a folder raises its own error.
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError(f"{path}: cannot be read (it is no file)")
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
        if len(data) > LARGEST_FILE:
            raise InputError(f"{path}: is too large, allowed are {LARGEST_FILE:,} bytes")
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
            if depth > DEEPEST:
                raise _too_deep(path, event.start_mark.line)
        return YAML(typ="rt").load(io.StringIO(text))
    except MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise InputError(f"{path}{where}: is not YAML ({cut(str(error.problem))})") from error
    except YAMLError as error:
        raise InputError(f"{path}: is not YAML ({cut(str(error))})") from error
    except InputError:
        raise
    except Exception as error:  # odd tags, keys and numbers raise errors of any type
        raise InputError(
            f"{path}: is not YAML that a scene can hold ({cut(str(error))})"
        ) from error


def _too_deep(path: Path, line: int = 0) -> InputError:
    return InputError(f"{path}:{line + 1}:1: is nested too deeply, allowed are {DEEPEST} levels")


def _mistakes(path: Path, document: Any, error: ValidationError) -> list[str]:
    lines: dict[tuple[Key, ...], str] = {}
    for number, mistake in enumerate(error.errors()):
        if len(lines) == MOST_MISTAKES:
            return [*lines.values(), f"{path}: and {error.error_count() - number} more mistakes"]
        kind, value = mistake["type"], mistake["input"]
        key = _written(document, mistake["loc"], missing=kind == "missing")
        if kind == "extra_forbidden":
            known = _known_keys(document, key[:-1])
            near = difflib.get_close_matches(cut(str(key[-1])), known, n=1, cutoff=0.7)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            sentence = f"is an unknown key; {hint}"
        elif kind == "missing":
            sentence = "is missing"
        elif kind in ("union_tag_invalid", "union_tag_not_found"):
            key = (*key, "kind")
            tags = ", ".join(_kind(model) for model in _options(document, key[:-1])[0])
            said = "is missing" if kind == "union_tag_not_found" else f"is {shown(value['kind'])}"
            sentence = f"{said}, allowed is one of {tags}"
        elif kind == "value_error":
            sentence = str(mistake["ctx"]["error"])
        else:
            written = list(value) if isinstance(value, tuple) else value
            sentence = f"is {shown(written)}, {_allowed(document, key) or mistake['msg']}"
        # A value that may be of two types is wrong as either, and is reported once.
        lines.setdefault(key, _complaint(path, document, key, sentence))
    return list(lines.values())


def _written(document: Any, location: Sequence[Key], *, missing: bool) -> tuple[Key, ...]:
    """Return the key as in the file, without the model's own intermediate steps."""
    key: list[Key] = []
    node = document
    for number, part in enumerate(location):
        held = isinstance(node, CommentedMap) and part in node
        counted = isinstance(node, CommentedSeq) and isinstance(part, int) and part < len(node)
        if held or counted:
            key.append(part)
            node = node[part]
        elif missing and number == len(location) - 1:
            key.append(part)
    return tuple(key)


def _allowed(document: Any, key: Sequence[Key]) -> str | None:
    """Describe the allowed values at `key`, from the scene's JSON schema."""
    schema = _schema()
    node: dict[str, Any] = schema
    written = document
    for part in key:
        node = _resolved(schema, node, written)
        if isinstance(part, int) and "items" in node:
            node = node["items"]
        elif isinstance(part, int) and part < len(node.get("prefixItems", [])):
            node = node["prefixItems"][part]
        elif part in node.get("properties", {}):
            node = node["properties"][part]
        else:
            return None
        written = written[part]
    words = [str(option["const"]) for option in node.get("anyOf", []) if "const" in option]
    node = _resolved(schema, node, written)
    if "enum" in node or "const" in node:
        values = node.get("enum", [node.get("const")])
        return f"allowed is one of {', '.join(map(str, values))}"
    bounds = [
        f"{sign} {node[name]:g}" if isinstance(node[name], float) else f"{sign} {node[name]}"
        for name, sign in (
            ("exclusiveMinimum", ">"),
            ("minimum", ">="),
            ("exclusiveMaximum", "<"),
            ("maximum", "<="),
        )
        if name in node
    ]
    if least := node.get("minLength", node.get("minItems")):
        bounds.append(f"of {'at least ' if least != node.get('maxItems') else ''}{least}")
    if factor := node.get("multipleOf"):
        bounds.append(f"a multiple of {factor}")
    kinds = {"integer": "a whole number", "number": "a number", "string": "a text"}
    kinds |= {"boolean": "true or false", "array": "a list", "object": "a mapping"}
    said = " ".join([kinds.get(node.get("type", ""), "a value"), *bounds])
    return f"allowed is {' or '.join([said, *words])}"


@functools.cache
def _schema() -> dict[str, Any]:
    return Scene.model_json_schema()


def _resolved(schema: dict[str, Any], node: dict[str, Any], written: Any) -> dict[str, Any]:
    """Follow references; take the option that is neither null nor a word, or named by `kind`."""
    for option in node.get("anyOf", []):
        if option.get("type") != "null" and "const" not in option:
            node = option
            break
    if "discriminator" in node:
        kind = written.get("kind", "block") if isinstance(written, CommentedMap) else "block"
        node = {"$ref": node["discriminator"]["mapping"].get(kind, "")}
    reference = node.get("$ref")
    if not reference:
        return node
    found: dict[str, Any] = schema["$defs"][str(reference).rpartition("/")[2]]
    return _resolved(schema, found, written) if "anyOf" in found else found


def _known_keys(document: Any, section: Sequence[Key]) -> list[str]:
    return list(_chosen(*_options(document, section)).model_fields)


def _options(document: Any, section: Sequence[Key]) -> tuple[list[type[BaseModel]], Any]:
    """Return the models allowed at a place of the file, and the value written there."""
    found: list[type[BaseModel]] = [Scene]
    written = document
    for part in section:
        if isinstance(part, str):
            found = _models(_chosen(found, written).model_fields[part].annotation)
        written = written[part]
    return found, written


def _chosen(options: list[type[BaseModel]], written: Any) -> type[BaseModel]:
    """Return the model that a section's `kind` names, if there are several; else the first."""
    kind = written.get("kind") if isinstance(written, CommentedMap) else None
    tagged = [model for model in options if len(options) > 1 and kind == _kind(model)]
    return (tagged or options)[0]


def _kind(model: type[BaseModel]) -> str:
    return str(get_args(model.model_fields["kind"].annotation)[0])


def _models(annotation: Any) -> list[type[BaseModel]]:
    """List the sections that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for option in get_args(annotation) for model in _models(option)]


def _complaint(path: Path, document: Any, key: Sequence[Key], sentence: str) -> str:
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
    label = f"{cut(name.lstrip('.'))} " if name else ""
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
        if self._values > MOST_VALUES:
            raise InputError(f"{self._path}: holds too many values, allowed are {MOST_VALUES:,}")
        if depth > DEEPEST:  # an alias within itself
            raise _too_deep(self._path)
        if isinstance(node, CommentedMap):
            return {key: self.of(value, depth + 1) for key, value in node.items()}
        if isinstance(node, CommentedSeq):
            return tuple(self.of(value, depth + 1) for value in node)
        if isinstance(node, bool) or node is None:
            return node
        for plain in (int, float, str):
            if isinstance(node, plain):
                return plain(node)
        return node
