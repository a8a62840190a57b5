import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.instrument.files import write_bytes
from tests.sealing import reseal
from tests.truth_rows import complete_row
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.dataset.writer import shard_writer


def everything_below(root: Path) -> list[str]:
    return sorted(str(path.relative_to(root)) for path in root.rglob("*"))


def test_a_shard_appears_whole_in_both_trees(tmp_path: Path) -> None:
    layout = Layout(tmp_path)
    for tree in (layout.observations, layout.truth):
        tree.mkdir()
    with shard_writer(layout, 3) as writer:
        image = np.full((4, 5), 7, np.uint8)
        writer.add(
            "abc", image, {"motor_angle_deg": 0.5}, {"x_c_mm": 1.25}, {"depth": np.ones((4, 5))}
        )
        assert everything_below(layout.observations) == []
    assert everything_below(tmp_path) == [
        "observations",
        "observations/shard_00003",
        "observations/shard_00003/abc.png",
        "observations/shard_00003/hashes.json",
        "observations/shard_00003/metadata.csv",
        "truth",
        "truth/shard_00003",
        "truth/shard_00003/abc.exr",
        "truth/shard_00003/hashes.json",
        "truth/shard_00003/truth.parquet",
    ]
    row = pl.read_parquet(tmp_path / "truth/shard_00003/truth.parquet").row(0, named=True)
    assert row == {"frame_id": "abc", "x_c_mm": 1.25}
    table = (tmp_path / "observations/shard_00003/metadata.csv").read_text().splitlines()
    assert table == ["file_name,frame_id,motor_angle_deg", "abc.png,abc,0.5"]


def test_an_interrupted_shard_leaves_nothing(tmp_path: Path) -> None:
    layout = Layout(tmp_path)

    def interrupted() -> None:
        with shard_writer(layout, 0) as writer:
            writer.add("abc", np.zeros((4, 5), np.uint8), {"step": 0}, {"x_c_mm": 1.25}, {})
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert everything_below(tmp_path) == []


def test_a_failed_write_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    write_bytes(path, b"old")

    def full_disk(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert everything_below(tmp_path) == ["file"]


def test_shards_of_which_one_has_no_contact_are_read_together(tmp_path: Path) -> None:
    layout = Layout(tmp_path)
    for tree in (layout.observations, layout.truth):
        tree.mkdir()
    for number, (x_c, force) in enumerate([(None, None), (1.5, [0.0, 1.0, 0.0])]):
        with shard_writer(layout, number) as writer:
            image = np.zeros((4, 5), np.uint8)
            contact = {"x_c_mm": x_c, "force_antenna_n": force}
            writer.add(f"f{number}", image, {"step": 0}, complete_row(**contact), {})
    rig = {"beam_length_mm": 1, "beam_diameter_mm": 1, "flexural_rigidity_n_mm2": 1}
    sizes = dict.fromkeys(["width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"], 1)
    pose = np.eye(4).tolist()
    camera = {**sizes, "camera_from_antenna": pose, "telecentric": False, "distortion": []}
    true_rig = {**rig, "base_position_mm": [0, 0, 0], "camera": camera}
    facts = {"scene": {}, "seed": 1, "variant": "", "true_rig": true_rig}
    layout.manifest.write_text(json.dumps(facts), encoding="utf-8")
    reseal(layout)
    frames = open_truth(layout.truth).frames
    assert frames["x_c_mm"].to_list() == [None, 1.5]
    assert frames["force_antenna_n"].to_list() == [None, [0.0, 1.0, 0.0]]
