"""The schema of a scene file as JSON Schema, by which an editor completes and checks it."""

from collections.abc import Mapping
from typing import Any, Final

from vbaa_bench.scene.distributions import DISTRIBUTIONS
from vbaa_bench.scene.mistakes import CLEARER
from vbaa_bench.scene.schema import Scene

# Set by the loader of scenes, never stated in a file.
_INTERNAL: Final = "random_keys"
# Keys of the whole set, and `kind`, which decides the keys of its section.
_NEVER_RANDOM: Final = ("title", "seed", "rigs", "random_method", "kind")
_DISTRIBUTION: Final = "distribution"


def scene_schema() -> dict[str, Any]:
    """Return the schema of the values of a scene, section by section (`$defs`)."""
    schema = Scene.model_json_schema()
    del schema["properties"][_INTERNAL]
    for section, names in CLEARER.items():
        model = schema["properties"][section]["anyOf"][0]["$ref"].rpartition("/")[2]
        keys = schema["$defs"][model]["properties"]
        for clearer, name in names.items():
            other = {**keys[name], "description": f"Another name of `{clearer}`."}
            renamed = {name: (clearer, keys[name])}
            keys = {
                new: value for key in keys for new, value in [renamed.get(key, (key, keys[key]))]
            }
            schema["$defs"][model]["properties"] = {**keys, name: other}
    return schema


def file_schema() -> dict[str, Any]:
    """Return the schema of a scene file, in which a distribution may stand in place of a value.

    Whether all values that may be drawn are allowed is checked when the scene is loaded.
    """
    schema = scene_schema()
    for section in (schema, *schema["$defs"].values()):
        for key, value in section.get("properties", {}).items():
            if key not in _NEVER_RANDOM:
                section["properties"][key] = _or_distribution(value)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["$defs"][_DISTRIBUTION] = _distribution_schema()
    return schema


def _or_distribution(value: Mapping[str, Any]) -> dict[str, Any]:
    """Allow a distribution in place of a value and of each of its items."""
    stated = {key: value[key] for key in ("description", "default") if key in value}
    inner = {key: value[key] for key in value.keys() - stated.keys()}
    if "items" in inner:
        inner["items"] = _or_distribution(inner["items"])
    if "prefixItems" in inner:
        inner["prefixItems"] = [_or_distribution(item) for item in inner["prefixItems"]]
    if "anyOf" in inner:
        inner["anyOf"] = [_or_distribution(option) for option in inner["anyOf"]]
    return {"anyOf": [inner, {"$ref": f"#/$defs/{_DISTRIBUTION}"}], **stated}


def _distribution_schema() -> dict[str, Any]:
    """Return the schema of a distribution, whose limits may be lists, for vectors and colours."""
    by_name = {
        name: field.description
        for one in DISTRIBUTIONS
        for key, field in one.model_fields.items()
        for name in [field.alias or key]
    }
    names = [next(name for name in one.model_json_schema()["required"]) for one in DISTRIBUTIONS]
    return {
        "type": "object",
        "properties": {name: {"description": text} for name, text in by_name.items()},
        "additionalProperties": False,
        "oneOf": [{"required": [name]} for name in names],
    }
