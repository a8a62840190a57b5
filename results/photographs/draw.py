"""Random rigs: a beam, a phone, and what a laboratory states about them."""

from typing import Any, Final, NamedTuple

import numpy as np

from results.photographs.materials import (
    GROUNDS,
    LEAST_CONTRAST,
    MATERIALS,
    Channel,
    Colour,
    best_channel,
)
from solver.instrument.units import DEGREE

# Image of a phone, reduced in size to 2 megapixels.
WIDTH_PX: Final = 1680
HEIGHT_PX: Final = 1260
GRAVITY_M_S2: Final = 9.81
# Sigmas with which the truth is drawn; those that a laboratory knows are stated in photos.json.
LENGTH_SIGMA_MM: Final = 0.5
RIGIDITY_SIGMA: Final = 0.2
FOCAL_SIGMA: Final = 0.1
VIEW_SIGMA_DEG: Final = 2.5
DOWN_SIGMA_DEG: Final = 0.5
TILT_SIGMA_DEG: Final = 0.4
TAPER_SIGMA: Final = 0.02
SOFTNESS_SIGMA: Final = 0.01
BOW_SIGMA: Final = 0.003  # over the length
K1_SIGMA: Final = 0.015
FORCE_SIGMA: Final = 0.002  # of a known force, over the force
PLACE_SIGMA_MM: Final = 1.0
# Largest tilt and roll of a phone held by hand.
_MOST_TURN_DEG: Final = 5.0
# Largest sag under the own weight, over the length.
_MOST_SAG: Final = 0.01
_WIDTHS_PX: Final = (2.0, 40.0)
_MOST_FORCE_N: Final = 10.0
# Images at rest, and range of those with a load.
_AT_REST: Final = 2
_LOADED: Final = (6, 8)
# Places of marks in plane C, over the length.
_MARKS: Final = ((0.0, -0.16), (0.5, -0.17), (1.0, -0.16), (0.7, 0.06))


class Load(NamedTuple):
    """A hung weight: force [N], arc length [mm] from the clamp, and whether both are stated."""

    force_n: float
    at_mm: float
    known: bool


class PhotoDraw(NamedTuple):
    """One photograph: keys of the scene's camera, rotation of the clamp, load, JPEG quality."""

    camera: dict[str, Any]
    tilt_deg: float
    load: Load | None
    quality: int


class RigDraw(NamedTuple):
    """A rig: true values by name, keys of its scene, colours of its surfaces, and photographs.

    `grain` is that of the beam's material, `stated` photos.json without its photographs, and
    `marks_mm` are places of known position in plane C.
    """

    truth: dict[str, Any]
    scene: dict[str, Any]
    colours: dict[str, Colour]
    grain: float
    stated: dict[str, Any]
    marks_mm: list[tuple[float, float]]
    photos: list[PhotoDraw]


def draw_rig(seed: int, number: int) -> RigDraw:
    """Draw one rig; it depends on `seed` and `number` only."""
    random = np.random.default_rng([seed, number])
    truth = _truth(random)
    material, ground = MATERIALS[truth["material"]], GROUNDS[truth["background"]]
    stated = _stated(random, truth, number)
    length = truth["length_mm"]
    count = int(random.integers(2, 1 + len(_MARKS))) if number % 4 < 2 else 0
    photos = _photos(random, truth)
    weights: tuple[Colour, ...] = ((0.55, 0.42, 0.16), (0.35, 0.36, 0.38), (0.05, 0.05, 0.06))
    return RigDraw(
        truth,
        _scene(random, truth, number),
        {"beam": material.colour, "background": ground.colour, "object": weights[number % 3]},
        material.grain,
        stated,
        [(x * length, y * length) for x, y in _MARKS[:count]],
        photos,
    )


def _truth(random: np.random.Generator) -> dict[str, Any]:
    """Draw beam, clamp, direction of gravity and lens."""
    normal, uniform = random.standard_normal, random.uniform
    length_mm = uniform(250, 450)
    material, ground = _looks(random)
    beam, length = MATERIALS[material], length_mm / 1e3
    modulus = beam.modulus_gpa * 1e9
    share = uniform(0.6, 0.85)
    px_per_mm = share * WIDTH_PX / length_mm
    # The sag under the own weight is 2 rho g L^4 / (E d^2).
    by_weight = 2 * beam.density_kg_m3 * GRAVITY_M_S2 * length**3 / (modulus * _MOST_SAG)
    thinnest = max(_WIDTHS_PX[0] / px_per_mm, 1e3 * by_weight**0.5)
    # A tip load of 5 % of the length is at most the largest force.
    stiffest = _MOST_FORCE_N * length**2 / (3 * 0.05)
    thickest = min(_WIDTHS_PX[1] / px_per_mm, 1e3 * (64 * stiffest / (np.pi * modulus)) ** 0.25)
    diameter_mm = float(np.exp(uniform(np.log(thinnest), np.log(thickest))))
    focal_px = uniform(0.75, 1.1) * WIDTH_PX
    down_deg = -90 + DOWN_SIGMA_DEG * normal()
    return {
        "material": material,
        "background": ground,
        "length_mm": length_mm,
        "diameter_mm": diameter_mm,
        "width_px": diameter_mm * px_per_mm,
        "share_of_image": share,
        "flexural_rigidity_n_mm2": modulus * np.pi * (diameter_mm / 1e3) ** 4 / 64 * 1e6,
        "tip_ratio": 1 + TAPER_SIGMA * normal(),
        "bow_mm": BOW_SIGMA * length_mm * normal(),
        "clamp_softness": abs(SOFTNESS_SIGMA * normal()),
        "down_deg": down_deg,
        "focal_length_px": focal_px,
        "k1": K1_SIGMA * normal(),
    }


def _stated(random: np.random.Generator, truth: dict[str, Any], number: int) -> dict[str, Any]:
    """Draw what the laboratory states: photos.json without its photographs."""
    normal = random.standard_normal
    channel, _ = _contrast(truth["material"], truth["background"])
    beam = {
        "length_mm": truth["length_mm"] + LENGTH_SIGMA_MM * normal(),
        "length_sigma_mm": LENGTH_SIGMA_MM,
    }
    camera = {"view_sigma_deg": VIEW_SIGMA_DEG}
    mark_sigma = float(random.uniform(0.7, 1.5))
    rigidity, focal = (
        truth[key] / (1 + sigma * float(np.clip(normal(), -2.5, 2.5)))
        for key, sigma in (
            ("flexural_rigidity_n_mm2", RIGIDITY_SIGMA),
            ("focal_length_px", FOCAL_SIGMA),
        )
    )
    if number % 2:
        beam["flexural_rigidity_n_mm2"] = rigidity
        beam["flexural_rigidity_sigma_n_mm2"] = RIGIDITY_SIGMA * rigidity
    if number % 3:
        camera["focal_length_px"] = focal
        camera["focal_length_sigma_px"] = FOCAL_SIGMA * focal
    return {
        "beam": beam,
        "beam_shape": {"taper_sigma": TAPER_SIGMA, "clamp_softness_sigma": SOFTNESS_SIGMA},
        "channel": channel,
        "camera": camera,
        "mark_sigma_px": mark_sigma,
        "down_deg": -90.0,
        "down_sigma_deg": DOWN_SIGMA_DEG,
    }


def _contrast(material: str, ground: str) -> tuple[Channel, float]:
    """Return the best channel for a beam before a background, and the contrast in it."""
    return best_channel(MATERIALS[material].colour, GROUNDS[ground].colour)


def _looks(random: np.random.Generator) -> tuple[str, str]:
    """Draw a material and a background that differ enough in some channel."""
    while True:
        material, ground = str(random.choice([*MATERIALS])), str(random.choice([*GROUNDS]))
        if _contrast(material, ground)[1] > LEAST_CONTRAST:
            return material, ground


def _photos(random: np.random.Generator, truth: dict[str, Any]) -> list[PhotoDraw]:
    loaded = int(random.integers(_LOADED[0], _LOADED[1] + 1))
    loads: list[Load | None] = [None] * _AT_REST
    loads += [_load(random, truth, known=i == 0) for i in range(loaded)]
    quality = int(random.integers(85, 96))
    return [
        PhotoDraw(
            _camera(random, truth),
            float(TILT_SIGMA_DEG * random.standard_normal()),
            load,
            quality,
        )
        for load in loads
    ]


def _load(random: np.random.Generator, truth: dict[str, Any], *, known: bool) -> Load:
    """Draw a place, and the force that bends the tip by 2 to 9 % of the length."""
    length = truth["length_mm"] / 1e3
    at = length * random.uniform(0.4, 0.97)
    tip = length * np.exp(random.uniform(np.log(0.02), np.log(0.09)))
    force = 6 * truth["flexural_rigidity_n_mm2"] / 1e6 * tip / (at**2 * (3 * length - at))
    return Load(float(force), float(1e3 * at), known)


def _camera(random: np.random.Generator, truth: dict[str, Any]) -> dict[str, Any]:
    """Draw the pose of a phone that is held about perpendicular to the beam's plane."""
    length, focal = truth["length_mm"], truth["focal_length_px"]
    share = truth["share_of_image"] * random.uniform(0.92, 1.04)
    distance = focal * length / (share * WIDTH_PX)
    tilts = np.clip(VIEW_SIGMA_DEG * random.standard_normal(2), -_MOST_TURN_DEG, _MOST_TURN_DEG)
    aim = length * (np.array([0.5, -0.06]) + 0.015 * random.standard_normal(2))
    x, y = aim + distance * np.tan(tilts * DEGREE)
    return {
        "mount": "world",
        "width_px": WIDTH_PX,
        "height_px": HEIGHT_PX,
        "focal_length_px": focal,
        "distortion": [truth["k1"], 0.0, 0.0, 0.0, 0.0],
        "position_mm": [float(x), float(y), float(distance)],
        "look_at_mm": [float(aim[0]), float(aim[1]), 0.0],
        "roll_deg": float(random.uniform(-_MOST_TURN_DEG, _MOST_TURN_DEG)),
    }


def _scene(random: np.random.Generator, truth: dict[str, Any], number: int) -> dict[str, Any]:
    """Draw the keys of a rig's scene, without camera, object and pushes."""
    length, diameter = truth["length_mm"], truth["diameter_mm"]
    material, ground = MATERIALS[truth["material"]], GROUNDS[truth["background"]]
    down = truth["down_deg"] * DEGREE
    jaw = 2 * diameter + 12
    scene: dict[str, Any] = {
        "title": "Photographs of a beam",
        "seed": int(random.integers(2**31)),
        "gravity_m_s2": [GRAVITY_M_S2 * np.cos(down), GRAVITY_M_S2 * np.sin(down), 0.0],
        "beam": {
            "length_mm": length,
            "diameter_mm": diameter,
            "youngs_modulus_gpa": material.modulus_gpa,
            "density_kg_m3": material.density_kg_m3,
            "allow_above_yield": True,
            "paint": material.paint,
            "tip_ratio": truth["tip_ratio"],
            "bow_mm": truth["bow_mm"],
            "clamp_softness": truth["clamp_softness"],
            "grime": {"dust_pct": 0.0, "dust_mm": diameter / 4},
            "centreline_segments": 400,
        },
        "clamp": {
            "jaw_mm": [1.4 * jaw, jaw, jaw],
            "screw_radius_mm": 0.2 * jaw,
            "flange_radius_mm": 0.6 * jaw,
            "paint": "gloss",
        },
        "hub": {"radius_mm": 0.4 * jaw},
        "background": {
            "distance_mm": float(random.uniform(0.15, 0.5)) * length + jaw,
            "pattern": "textured",
            "reflectance": 0.4,
            "contrast": ground.contrast,
            "correlation_mm": 2.0,
            "correlation_ratio": ground.ratio,
            "fixed_to": "world",
        },
        "ambient": {"irradiance": float(random.uniform(0.4, 1.0))},
        "lights": [
            {
                "kind": "area",
                "position_mm": [
                    float(random.uniform(-1.5, 2.5)) * length,
                    float(random.choice([-1.6, 1.6])) * length,
                    float(random.uniform(2.0, 3.0)) * length,
                ],
                "size_mm": [2.0 * length, 1.5 * length],
            }
        ],
    }
    if number % 3 == 0:
        scene["clutter"] = {"count": 6, "size_mm": [0.03 * length, 0.12 * length]}
    return scene
