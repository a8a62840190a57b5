"""What the light, paint and background sections of a scene allow."""

from typing import Any

import pytest
from pydantic import ValidationError

from vbaa_bench.scene.schema import Scene


def scene(**parts: Any) -> Scene:
    pushes = {"contact_distance_mm": (100.0,), "deflection_pct": (10.0,)}
    return Scene.model_validate({"title": "light", "seed": 1, "pushes": pushes, **parts})


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (
            {"light": {"side_mm": 500.0}, "lights": ({"kind": "ring"},)},
            "light and lights are both given",
        ),
        (
            {"lights": ({"kind": "ring", "inner_radius_mm": 50.0, "outer_radius_mm": 50.0},)},
            "inner_radius_mm is 50, allowed is less than outer_radius_mm, 50",
        ),
        (
            {"lights": ({"kind": "back", "height_above_background_mm": 30.0},)},
            "height_above_background_mm is 30, allowed is less than background.distance_mm, 30",
        ),
        (
            {
                "lights": ({"kind": "ring"},),
                "camera": {"position_mm": (120.0, 18.0, -5.0), "look_at_mm": (120.6, 20.0, -50.0)},
            },
            "camera.position_mm has height -5",
        ),
        (
            {"lights": ({"kind": "spot", "position_mm": (120.6, 20.0, 0.0)},)},
            "position_mm is equal to the aim",
        ),
        ({"beam": {"paint": "bare", "roughness": 0.05}}, "greater than or equal to 0.1"),
        ({"object": {"kind": "block", "paint": "chrome"}}, "'matt', 'gloss', 'bare' or 'black'"),
        ({"lights": ({"kind": "sun"},)}, "'area', 'side', 'ring'"),
        ({"background": {"pattern": "textured", "contrast": 2.0}}, "less than or equal to 1"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(parts: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError) as caught:
        scene(**parts)
    assert any(said in mistake["msg"] for mistake in caught.value.errors())


def test_todays_light_needs_no_new_key() -> None:
    plain = scene(light={"side_mm": 700.0, "height_mm": 420.0})
    assert plain == scene()
    assert plain.lights == ()
    assert (plain.beam.paint, plain.object.paint, plain.hub.paint) == ("gloss", "matt", "matt")  # type: ignore[attr-defined]
    assert (plain.beam.reflectance, plain.hub.reflectance) == (0.85, 0.10)
