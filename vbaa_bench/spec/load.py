"""YAML 1.2 -> Scene. Every mistake in the file is listed at once, with its place."""

import difflib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from solver.instrument.errors import InputError
from vbaa_bench.spec.scene import Scene

Key = str | int


@dataclass(frozen=True)
class SceneFile:
    """A scene with the file it came from, so that later findings can name their line."""

    path: Path
    scene: Scene
    _document: Any

    def complaint(self, key: Sequence[Key], sentence: str) -> str:
        """`file:line:column: key: sentence` for the value at `key`, or the nearest above it."""
        return _complaint(self.path, self._document, key, sentence)


def load_scene(path: Path, seed: int | None = None) -> SceneFile:
    """Read and check a scene; `seed` replaces the file's. Raises InputError with all mistakes."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text") from error
    try:
        document = YAML(typ="rt").load(io.StringIO(text))
    except MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise InputError(f"{path}{where}: is not YAML ({error.problem})") from error
    except YAMLError as error:
        raise InputError(f"{path}: is not YAML ({error})") from error
    if not isinstance(document, CommentedMap):
        raise InputError(f"{path}:1:1: is {document!r}, allowed is a mapping of keys to values")
    plain = _plain(document)
    if seed is not None:
        plain["seed"] = seed
    try:
        scene = Scene.model_validate(plain)
    except ValidationError as error:
        raise InputError("\n".join(_mistakes(path, document, error))) from error
    return SceneFile(path, scene, document)


def _mistakes(path: Path, document: Any, error: ValidationError) -> list[str]:
    lines = []
    for mistake in error.errors():
        key = tuple(part for part in mistake["loc"] if not str(part).startswith("function-"))
        kind, value = mistake["type"], mistake["input"]
        if kind == "extra_forbidden":
            known = _known_keys(key[:-1])
            near = difflib.get_close_matches(str(key[-1]), known, n=1, cutoff=0.7)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            sentence = f"is an unknown key; {hint}"
        elif kind == "missing":
            sentence = "is missing"
        elif kind == "value_error":
            sentence = str(mistake["ctx"]["error"])
        else:
            shown = list(value) if isinstance(value, tuple) else value
            sentence = f"is {shown!r}, {_allowed(key) or mistake['msg']}"
        lines.append(_complaint(path, document, key, sentence))
    return lines


def _allowed(key: Sequence[Key]) -> str | None:
    """The allowed values at `key`, from the scene's own JSON schema."""
    schema = Scene.model_json_schema()
    node: dict[str, Any] = schema
    for part in key:
        node = _resolved(schema, node)
        if isinstance(part, int) and "items" in node:
            node = node["items"]
        elif isinstance(part, int) and part < len(node.get("prefixItems", [])):
            node = node["prefixItems"][part]
        elif part in node.get("properties", {}):
            node = node["properties"][part]
        else:
            return None
    node = _resolved(schema, node)
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
    words = {"integer": "a whole number", "number": "a number", "string": "a text"}
    words |= {"boolean": "true or false", "array": "a list", "object": "a mapping"}
    return f"allowed is {' '.join([words.get(node.get('type', ''), 'a value'), *bounds])}"


def _resolved(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    """Follow references, and take the list of an optional list."""
    for option in node.get("anyOf", []):
        if option.get("type") != "null":
            node = option
            break
    reference = node.get("$ref")
    if reference is None:
        return node
    found: dict[str, Any] = schema["$defs"][str(reference).rpartition("/")[2]]
    return found


def _known_keys(section: Sequence[Key]) -> list[str]:
    model: type[BaseModel] = Scene
    for part in section:
        annotation = model.model_fields[str(part)].annotation
        assert isinstance(annotation, type)
        model = annotation
    return list(model.model_fields)


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
        except (KeyError, TypeError):  # a place the parser did not note
            break
    name = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key)
    label = f"{name.lstrip('.')} " if name else ""
    return f"{path}:{line + 1}:{column + 1}: {label}{sentence}"


def _plain(node: Any) -> Any:
    """Plain Python of a parsed document: lists become tuples, as the scene's strict types ask."""
    if isinstance(node, CommentedMap):
        return {key: _plain(value) for key, value in node.items()}
    if isinstance(node, CommentedSeq):
        return tuple(_plain(value) for value in node)
    if isinstance(node, bool) or node is None:
        return node
    for plain in (int, float, str):
        if isinstance(node, plain):
            return plain(node)
    return node
