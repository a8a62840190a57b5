"""Presets of keys that together make a certain look; a scene's own keys replace them."""

from collections.abc import Mapping
from typing import Any, Final, Literal

Look = Literal["laboratory"]

# A wooden table in a room with light walls: grain along x, things on the table, a dusty wire in a
# clamp, light from all around, light reflected once between surfaces, and a lens that is darker and
# not quite sharp towards the corners. All values are chosen: none was measured in a laboratory.
PRESETS: Final[Mapping[str, Mapping[str, Any]]] = {
    "laboratory": {
        "beam": {"grime": {}},
        "optics": {"point_spread_px": 0.5, "vignetting_pct": 25.0},
        "ambient": {"irradiance": 0.35},
        "background": {
            "pattern": "textured",
            "reflectance": 0.2,
            "contrast": 0.2,
            "correlation_mm": 2.0,
            "correlation_ratio": 12.0,
        },
        "clutter": {"count": 16},
        "clamp": {},
        "render": {"bounces": 2},
    }
}


def with_preset(keys: Mapping[str, Any]) -> Mapping[str, Any]:
    """Add the keys of the preset that `look` names to a scene's own keys, which win."""
    preset = PRESETS.get(str(keys.get("look")), {})
    return _merged(preset, keys) if preset else keys


def _merged(preset: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Merge sections key by key; a value that is no section is replaced as a whole."""
    merged = {**preset, **keys}
    for name in preset.keys() & keys.keys():
        if isinstance(preset[name], Mapping) and isinstance(keys[name], Mapping):
            merged[name] = _merged(preset[name], keys[name])
    return merged
