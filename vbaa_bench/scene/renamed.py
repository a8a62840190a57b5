"""Keys of scenes that have been renamed, so that a message can name the new key."""

from typing import Final

# Section -> old key -> new key. A section within a list has no index; "" is the scene itself.
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


def new_key(section: str, key: str) -> str | None:
    """Return the present name of a key of a section, or None if it was never renamed."""
    return RENAMED.get(section, {}).get(key)
