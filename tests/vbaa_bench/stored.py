"""Datasets that are written without a renderer: random images, and truth made up for the test."""

from pathlib import Path

from tests.draws import generator
from tests.truth_rows import complete_row
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import seal
from vbaa_bench.dataset.writer import shard_writer
from vbaa_bench.sensor.quantise import quantise

TRUE_RIG = {
    "beam_length_mm": 240.0,
    "beam_diameter_mm": 0.8,
    "flexural_rigidity_n_mm2": 4021.0,
    "base_position_mm": [0.0, 0.0, 0.0],
    "camera": {
        "width_px": 12,
        "height_px": 8,
        "fx_px": 20.0,
        "fy_px": 20.0,
        "cx_px": 5.5,
        "cy_px": 3.5,
        # It looks at the middle of the beam from a distance of 0.3 m.
        "camera_from_antenna": [[1, 0, 0, -0.12], [0, -1, 0, 0], [0, 0, -1, 0.3], [0, 0, 0, 1]],
        "telecentric": False,
        "distortion": [],
    },
}


def store(
    root: Path, frames: int = 12, bits: int = 8, splits: tuple[str, ...] = (), per_shard: int = 5
) -> Path:
    """Write a dataset whose frame i has the split i modulo their number; the first is free."""
    layout, random = Layout(root), generator(__name__, 3)
    whole: dict[str, dict[str, str]] = {"observations": {}, "truth": {}}
    for tree in layout.trees:
        tree.mkdir(parents=True)
    for number in range(-(-frames // per_shard)):
        with shard_writer(layout, number) as writer:
            for i in range(number * per_shard, min((number + 1) * per_shard, frames)):
                image = quantise(random.random((8, 12)), bits)
                readings = {"motor_angle_deg": "" if i == 1 else -0.5 * i, "push_id": f"p{i // 2}"}
                split = {"split": splits[i % len(splits)]} if splits else {}
                contact = {
                    "x_c_mm": 10.0 * i,
                    "k_s_n_m": 200.0 if i % 2 else None,
                    "contact_antenna_mm": [10.0 * i, 1.0, 0.0],
                }
                truth = contact if i else dict.fromkeys(contact)
                other = dict.fromkeys(("y_c_mm", "s_c_mm", "force_n", "f_n"), 0.1 * i)
                angles = {"model": "exact", "step": i % 2}
                line = {f"centreline_{axis}_mm": [0.0, 0.0] for axis in "yz"}
                line |= {f"centreline_{axis}_mm": [0.0, 240.0] for axis in "sx"}
                place = {
                    "trial": i,
                    "true_motor_angle_deg": -0.5 * i,
                    "deflection_pct": 5.0,
                    "contact_row": 0 if i else None,
                }
                # Any order of the names: rows are joined by frame_id.
                name = f"{(7 * i) % 100:04d}"
                writer.add(
                    name,
                    image,
                    {**readings, "step": i % 2, **split},
                    complete_row(**truth, **(other if i else {}), **angles, **line, **place),
                    {},
                )
        for name, value in writer.digests.items():
            whole[name][f"shard_{number:05d}/hashes.json"] = value
    scene = {
        "sensor": {"bits": bits},
        "camera": {"mount": "antenna"},
        "clamp_offset_mm": [0.0, 0.0, 0.0],
    }
    seal(layout, {"scene": scene, "seed": 1, "variant": "none", "true_rig": TRUE_RIG}, whole)
    return root
