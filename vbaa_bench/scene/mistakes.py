"""Sentences for the mistakes in a scene, each with file, line, column and key."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from solver.instrument.errors import quoted, suggestion, truncated
from vbaa_bench.scene.families import family_of, kind_of, names_of, sections
from vbaa_bench.scene.part import KeyPath
from vbaa_bench.scene.random_keys import DistributionError
from vbaa_bench.scene.schema import Scene

# Chosen: the length of a list of mistakes that a terminal shows.
MAX_MISTAKES: Final = 20
# Keys with a clearer name in files: section -> that name -> the one in the records of datasets.
# A file may state either.
CLEARER: Final = {"pushes": {"draws": "repeats"}}
# Attribute of a document: the settings that replaced its values, by their keys.
SETTINGS: Final = "vbaa_settings"
# What pydantic's types of Python are in YAML, by its kind of error.
_IN_YAML: Final = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "a section of keys",
    "list_type": "a list",
    "model_attributes_type": "a section of keys",
    "model_type": "a section of keys",
    "string_type": "a text, in quotes if it looks like a number",
    "tuple_type": "a list",
}
# Keys that have been renamed: section -> old key -> new key. A section within a list has no index;
# "" is the scene itself.
RENAMED: Final = {
    "": {"adaptor_mm": "clamp_offset_mm"},
    "beam": {"pieces": "centreline_segments", "aspect": "aspect_ratio"},
    "camera": {"sees_tip": "tip_in_view"},
    "optics": {"spread_px": "point_spread_px", "focus_mm": "focus_distance_mm"},
    "lights": {
        "inner_mm": "inner_radius_mm",
        "outer_mm": "outer_radius_mm",
        "lift_mm": "height_above_background_mm",
        "edge_mm": "edge_width_mm",
        "turn_deg": "rotation_deg",
        "cone_deg": "cone_angle_deg",
    },
    "background": {"grain": "correlation_ratio", "lies_in": "fixed_to"},
    "render": {"noise_still": "noise_static_layer"},
}


def listed_mistakes(
    path: Path, document: Any, errors: Iterable[Any], model: type[BaseModel] = Scene
) -> list[str]:
    """List pydantic's errors in a document of a model as `file:line:column: key: sentence`."""
    sentences_by_key: dict[KeyPath, list[str]] = {}
    for mistake in errors:
        key, sentence = _mistake(document, mistake, model)
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
        located_message(path, document, key, " or ".join(sentences_by_key[key])) for key in keys
    ]
    if len(lines) > MAX_MISTAKES:
        rest = f"{path}: and {len(lines) - MAX_MISTAKES} more mistakes"
        return [*lines[:MAX_MISTAKES], rest]
    return lines


def _mistake(document: Any, mistake: Any, model: type[BaseModel] = Scene) -> tuple[KeyPath, str]:
    """Return the key of one of pydantic's errors, as in the file, and a sentence."""
    kind, value, context = mistake["type"], mistake["input"], mistake.get("ctx", {})
    key = _key_in_file(document, mistake["loc"], missing=kind == "missing")
    match kind:
        case "missing":
            return key, "is missing"
        case "extra_forbidden":
            return key, f"is an unknown key; {_hint(key, mistake['loc'], model)}"
        case "union_tag_invalid" | "union_tag_not_found":
            state = "missing" if kind == "union_tag_not_found" else quoted(value["kind"])
            allowed = ", ".join(str(kind_of(kind)) for kind in _models(mistake["loc"], model))
            remedy = _remedy(mistake, model)
            return (*key, "kind"), f"is {state}, allowed is one of {allowed}{remedy}"
        case "value_error":
            return key, str(context["error"])
        case "literal_error":
            allowed = f"one of {context['expected']}".replace("'", "").replace(" or ", ", ")
            allowed += _remedy(mistake, model)
        case "too_short":
            allowed = f"a list of at least {context['min_length']}"
        case "string_too_short":
            allowed = f"a text of at least {context['min_length']} character"
        case "too_long":
            allowed = f"a list of at most {context['max_length']}"
        case _ if kind in _IN_YAML:
            allowed = _IN_YAML[kind]
        case _:
            allowed = mistake["msg"].removeprefix("Input should be ").replace("a valid ", "a ")
            allowed = allowed.replace("integer", "whole number")
    plain_value = list(value) if isinstance(value, tuple) else value
    return key, f"is {quoted(plain_value)}, allowed is {allowed}"


def _remedy(mistake: Any, model: type[BaseModel]) -> str:
    """Return what to do if an unknown kind is that of a user's module."""
    return "; a kind of your own needs --module" if unknown_kind(mistake, model) else ""


def unknown_kind(mistake: Any, model: type[BaseModel] = Scene) -> str | None:
    """Return the name of an unknown kind, which may be a user's; None for another mistake."""
    kind, field = None, _field(mistake["loc"], model)
    match mistake["type"]:
        case "union_tag_invalid" if family_of(field) is not None:
            kind = mistake["input"]["kind"]
        case "literal_error" if names_of(field) is not None:
            kind = mistake["input"]
    return kind if isinstance(kind, str) else None


def _hint(key: Sequence[str | int], location: Sequence[str | int], model: type[BaseModel]) -> str:
    """Suggest the key that is meant by an unknown one, or list those of its section."""
    name = str(location[-1])
    section = next((str(part) for part in key[:-1] if isinstance(part, str)), "")
    if renamed := RENAMED.get(section, {}).get(name):
        return f"it is now called {renamed}"
    # Random keys are stated in the places of their values, not in a list.
    known = [
        name for name in _models(location[:-1], model)[0].model_fields if name != "random_keys"
    ]
    known += CLEARER.get(section, {})
    return suggestion(name, known)


def _key_in_file(document: Any, location: Sequence[str | int], *, missing: bool) -> KeyPath:
    """Return the key as in the file, without the model's own intermediate steps."""
    key: list[str | int] = []
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


def _models(location: Sequence[str | int], model: type[BaseModel]) -> list[type[BaseModel]]:
    """List the sections that are allowed at a location of pydantic's, which names their `kind`."""
    return sections(_field(location, model))


def _field(location: Sequence[str | int], model: type[BaseModel]) -> Any:
    """Return the field, or the model, at a location of pydantic's within a model."""
    field: Any = model
    for part in location:
        if isinstance(part, int):
            continue
        models = sections(field)
        matching = [m for m in models if len(models) > 1 and kind_of(m) == part]
        # A part that is no key is a name in a mapping, whose values have the same model.
        known = models[0].model_fields if models else {}
        field = matching[0] if matching else known.get(part, field)
    return field


def located_message(path: Path, document: Any, key: Sequence[str | int], sentence: str) -> str:
    """Return `file:line:column: key: sentence` for a key, or for the nearest key above it.

    For a value in place of the file's it is `file with setting: key: sentence`.
    """
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
    settings = getattr(document, SETTINGS, {})
    above = (tuple(key[:length]) for length in range(len(key), 0, -1))
    if setting := next((settings[part] for part in above if part in settings), None):
        return f"{path} with {setting}: {label}{sentence}"
    # A scene that is built in Python has no lines.
    place = f":{line + 1}:{column + 1}" if document.lc.line is not None else ""
    return f"{path}{place}: {label}{sentence}"


def distribution_mistakes(path: Path, document: Any, error: DistributionError) -> list[str]:
    """List the mistakes in one distribution."""
    if not isinstance(error.reason, ValidationError):
        return [located_message(path, document, error.path, str(error.reason))]
    lines = []
    for mistake in error.reason.errors():
        # The first step of the location is the distribution's own name.
        key = (*error.path, *mistake["loc"][1:])
        if mistake["type"] == "extra_forbidden":
            sentence = f"is an unknown key of the distribution {mistake['loc'][0]}"
        else:
            sentence = _mistake(document, {**mistake, "loc": key})[1]
        lines.append(located_message(path, document, key, sentence))
    return lines[:MAX_MISTAKES]
