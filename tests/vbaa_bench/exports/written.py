"""Small datasets for tests of exports, written without a renderer."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver.instrument.images import png_bytes
from tests.draws import generator
from tests.sealing import reseal
from tests.truth_rows import complete_row
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import shard_writer


class Size(NamedTuple):
    """Number of pushes and of their steps, frames per shard, image size and depth."""

    pushes: int = 3
    steps: int = 3
    per_shard: int = 2
    width: int = 24
    height: int = 10
    bits: int = 8


USUAL = Size()


def write_dataset(
    root: Path,
    size: Size = USUAL,
    *,
    splits: Sequence[str] = (),
    mount: str = "antenna",
    telecentric: bool = False,
    seed: int = 1,
) -> Path:
    """Write a complete dataset of random images at `root`, in the order of opaque names."""
    random, layout = generator(__name__, seed), Layout(root)
    for folder in ("rest", "calibration"):
        (layout.observations / folder).mkdir(parents=True)
    layout.truth.mkdir(parents=True)
    kind = np.uint16 if size.bits == 16 else np.uint8
    shape = (size.height, size.width)
    picture = png_bytes(random.integers(0, 2**size.bits, shape, dtype=kind))
    (layout.observations / "rest" / "rest_00.png").write_bytes(picture)
    (layout.observations / "calibration" / "view_00.png").write_bytes(picture)
    (layout.observations / "rig.json").write_text("{}\n", encoding="utf-8")
    layout.manifest.write_text(json.dumps(manifest(size, mount, telecentric)), encoding="utf-8")
    frames = [(push, step) for push in range(size.pushes) for step in range(size.steps)]
    names = [bytes(random.integers(0, 256, 8, dtype=np.uint8)).hex() for _ in frames]
    order = np.argsort(names)
    for shard in range(-(-len(frames) // size.per_shard)):
        with shard_writer(layout, shard) as writer:
            for i in order[shard * size.per_shard : (shard + 1) * size.per_shard]:
                push, step = frames[i]
                split = {"split": splits[push % len(splits)]} if splits else {}
                angle = "" if mount == "world" else float(random.normal())
                name = {"push_id": f"push{seed}{push}", "step": step}
                writer.add(
                    names[i],
                    random.integers(0, 2**size.bits, shape, dtype=kind),
                    {"motor_angle_deg": angle, **name, **split, "moment_y_n_mm": 0.1 * step},
                    {**truth(random, free=step == 0 and push == 0), **name},
                    {},
                )
    reseal(layout)
    return root


def truth(random: np.random.Generator, free: bool) -> dict[str, Any]:
    """Draw the truth of a frame, which touches something unless it is `free`."""
    contact = random.normal(size=3)
    return complete_row(
        model="exact",
        trial=int(random.integers(1000)),
        true_motor_angle_deg=float(random.normal()),
        x_c_mm=None if free else float(contact[0]),
        contact_row=None if free else int(random.integers(400)),
        force_antenna_n=None if free else [0.0, float(random.normal()), 0.2],
        contact_antenna_mm=None if free else contact.tolist(),
        contact_world_mm=None if free else contact.tolist(),
        k_s_n_m=None,
        hidden_by=None,
        visible_share=0.9,
        hidden_stretches_mm=[1.0, 2.5] if free else [],
        above_yield=False,
        centreline_s_mm=[0.0, 1.0, 2.0],
        centreline_x_mm=[0.0, 1.0, 2.0],
        centreline_y_mm=random.normal(size=3).tolist(),
        centreline_z_mm=[0.0, 0.0, 0.0],
    )


def manifest(size: Size, mount: str, telecentric: bool) -> dict[str, Any]:
    """Make a manifest with the keys that are read."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 0.3
    camera = {"width_px": size.width, "height_px": size.height, "cx_px": 11.5, "cy_px": 4.5}
    return {
        "scene": {
            "title": 'Random "images"',
            "camera": {"mount": mount},
            "clamp_offset_mm": [0.0, 0.0, 0.0],
            "layers": [],
            "splits": None,
        },
        "seed": 1,
        "variant": "none",
        "true_rig": {
            "beam_length_mm": 200.0,
            "beam_diameter_mm": 0.8,
            "flexural_rigidity_n_mm2": 1e3,
            "base_position_mm": [0.5, 0.25, 0.0],
            "camera": {
                **camera,
                "fx_px": 30.0,
                "fy_px": 30.0,
                "telecentric": telecentric,
                "distortion": [],
                "camera_from_antenna": pose.tolist(),
            },
        },
    }


def write_collection(root: Path, sizes: Sequence[Size]) -> Path:
    """Write a collection of one dataset per size."""
    root.mkdir()
    (root / "collection.json").write_text('{"title": "Rigs"}', encoding="utf-8")
    for number, size in enumerate(sizes):
        write_dataset(root / f"rig_{number:05d}", size, splits=["train", "test"], seed=number)
    return root
