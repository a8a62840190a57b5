"""Frames for training: records, splits, depths, damage; with PyTorch where it is installed."""

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import polars as pl
import pytest

import vbaa_bench as vb
from solver.instrument.errors import DamageError, InputError
from tests.vbaa_bench.stored import store
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.frame_index import index_frames
from vbaa_bench.dataset.frame_records import FrameRecords, Record
from vbaa_bench.dataset.labels import USUAL_LABELS, to_array


def arrays(root: Path, split: str | None = "train", **options: Any) -> FrameRecords:
    """Open a dataset as without PyTorch."""
    raw, labels = options.get("raw", False), options.get("labels", USUAL_LABELS)
    index = index_frames(root, split, labels, check=options.get("check", True))
    return FrameRecords(index, raw, options.get("transform"))


def stored_image(root: Path, frame_id: str) -> np.ndarray:
    (path,) = root.glob(f"observations/shard_*/{frame_id}.png")
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image


def test_records_join_image_truth_and_readings(tmp_path: Path) -> None:
    records = arrays(store(tmp_path / "set"))
    assert len(records) == 12
    by_id = {record["frame_id"]: record for record in records}
    assert len(by_id) == 12
    for i in range(12):
        record = by_id[f"{(7 * i) % 100:04d}"]
        assert record["push_id"] == f"p{i // 2}"
        assert (record["step"], record["rig"]) == (i % 2, 0)
        expected = stored_image(tmp_path / "set", record["frame_id"])
        assert record["image"].dtype == np.float32
        assert np.array_equal(record["image"], expected[None].astype(np.float32) / np.float32(255))
        labels = record["labels"]
        assert tuple(labels) == USUAL_LABELS
        assert labels["contact"] == (i > 0)
        assert labels["contact"].dtype == bool
        truth = (10.0 * i, 5.0 * (i % 2)) if i else (np.nan, np.nan)
        found = [labels["x_c_mm"], labels["compliance_mm_per_n"]]
        np.testing.assert_array_equal(found, np.array(truth, np.float32))
        assert np.isnan(labels["psi_deg"]) == (i == 0)
        angle = np.nan if i == 1 else -0.5 * i
        np.testing.assert_array_equal(record["readings"]["motor_angle_deg"], np.float32(angle))
        assert list(record["readings"]) == ["motor_angle_deg"]
    assert records[-1]["frame_id"] == records[11]["frame_id"]
    with pytest.raises(IndexError):
        records[12]


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
@pytest.mark.parametrize("bits", [12, 16])
def test_no_bit_of_deep_images_is_lost(tmp_path: Path, bits: int) -> None:
    root = store(tmp_path / "set", frames=3, bits=bits)
    images = {record["frame_id"]: record["image"] for record in arrays(root)}
    for record in arrays(root, raw=True):
        expected = stored_image(root, record["frame_id"])
        assert record["image"].dtype == expected.dtype == np.uint16
        assert np.array_equal(record["image"], expected[None])
        scaled = images[record["frame_id"]]
        assert np.array_equal(np.rint(scaled.astype(float) * (2**bits - 1)), expected[None])
        assert 0.9 < scaled.max() <= 1


def test_splits(tmp_path: Path) -> None:
    root = store(tmp_path / "set", splits=("train", "train", "test"))
    parts = {name: {record["frame_id"] for record in arrays(root, name)} for name in ("test", None)}
    train = {record["frame_id"] for record in arrays(root)}
    assert parts["test"] == {f"{(7 * i) % 100:04d}" for i in (2, 5, 8, 11)}
    assert train | parts["test"] == parts[None]
    assert not train & parts["test"]
    with pytest.raises(InputError) as refused:
        arrays(root, "validation")
    assert str(refused.value) == (
        f"{root}: the split 'validation' does not exist, allowed is test, train"
    )


def test_labels_are_chosen(tmp_path: Path) -> None:
    root = store(tmp_path / "set")
    labels = arrays(root, labels=["contact_antenna_mm", "force_n"])[3]["labels"]
    assert list(labels) == ["contact_antenna_mm", "force_n"]
    assert labels["contact_antenna_mm"].shape == (3,)
    assert arrays(root, labels=[])[0]["labels"] == {}
    first = next(r for r in arrays(root, labels=["contact_antenna_mm"]) if r["frame_id"] == "0000")
    assert np.isnan(first["labels"]["contact_antenna_mm"]).all()
    for name, hint in (("model", "known are .*x_c_mm"), ("force_nn", "did you mean force_n")):
        with pytest.raises(InputError, match=rf"'{name}' is no column of numbers .*; {hint}"):
            arrays(root, labels=[name])


def test_lists_of_one_length(dataset: Path) -> None:
    records = arrays(dataset, labels=["centreline_y_mm"])
    assert records[0]["labels"]["centreline_y_mm"].shape == (481,)
    with pytest.raises(InputError, match=r"label centreline_y_mm has lists of 1 to 3 numbers"):
        to_array(pl.Series("centreline_y_mm", [[1.0], [1.0, 2.0, 3.0], None]), dataset)


@pytest.mark.false_alarm(0.0, "the values are bounded, whatever is drawn")
def test_a_collection_gives_the_number_of_the_rig(tmp_path: Path) -> None:
    layout = CollectionLayout(tmp_path)
    for rig in (1, 4):
        store(layout.rig(rig).root, frames=3, bits=8 * (1 + rig % 2))
    layout.scene.write_text("{}", encoding="utf-8")
    records = arrays(tmp_path)
    assert [record["rig"] for record in records] == [1, 1, 1, 4, 4, 4]
    deep, flat = arrays(tmp_path, raw=True)[0]["image"], records[5]["image"]
    assert deep.dtype == np.uint16
    assert 0.5 < records[0]["image"].max() <= 1
    assert 0.5 < flat.max() <= 1


def test_a_damaged_image_is_refused(tmp_path: Path) -> None:
    root = store(tmp_path / "set")
    (path,) = root.glob("observations/shard_*/0007.png")
    damaged = bytearray(path.read_bytes())
    records, unchecked = arrays(root), arrays(root, check=False)
    damaged[-20] ^= 1
    path.write_bytes(damaged)
    (number,) = [i for i, name in enumerate(records.index.frame_id) if name == b"0007"]
    with pytest.raises(DamageError, match=r"0007.png: is not what was generated"):
        records[number]
    path.write_bytes(b"")
    with pytest.raises(InputError, match=r"0007.png: is not an image"):
        unchecked[number]
    path.unlink()
    with pytest.raises(InputError, match=r"0007.png: cannot be read"):
        records[number]


def test_a_damaged_table_is_refused(tmp_path: Path) -> None:
    root = store(tmp_path / "set")
    (table,) = root.glob("truth/shard_00001/truth.parquet")
    content = table.read_bytes()
    table.write_bytes(content[:-30] + bytes(30))
    with pytest.raises(DamageError, match=r"truth.parquet: is not what was generated"):
        arrays(root)
    with pytest.raises(InputError, match=r"shard_00001: its tables cannot be read"):
        arrays(root, check=False)
    table.write_bytes(next(root.glob("truth/shard_00000/truth.parquet")).read_bytes())
    with pytest.raises(InputError, match=r"shard_00001: .* list different frames"):
        arrays(root, check=False)
    with pytest.raises(InputError, match=r"is not a dataset"):
        arrays(tmp_path)


def test_records_are_compact_and_can_be_sent_to_other_processes(tmp_path: Path) -> None:
    root = store(tmp_path / "set", frames=200, per_shard=100)
    records = arrays(root)
    content = pickle.dumps(records)
    # A million frames fit into 200 MB: 36 bytes of numbers, 32 of hash, and the ids.
    assert len(content) < 200 * len(records)
    copy = pickle.loads(content)
    assert np.array_equal(copy[150]["image"], records[150]["image"])


def _flipped(record: Record) -> np.ndarray:
    flipped: np.ndarray = record["image"][:, ::-1]
    return flipped


def test_a_transform_gets_the_record(tmp_path: Path) -> None:
    root = store(tmp_path / "set", frames=2)
    records = arrays(root, transform=_flipped)
    assert np.array_equal(records[1], arrays(root)[1]["image"][:, ::-1])


@pytest.mark.thorough
def test_it_needs_no_renderer(tmp_path: Path) -> None:
    root = store(tmp_path / "set", frames=2)
    code = (
        "import sys, vbaa_bench\n"
        f"print(len(vbaa_bench.torch_dataset({str(root)!r})))\n"
        "print(*sys.modules.keys() & {'mitsuba', 'drjit', 'trimesh'})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["2"]


def test_pytorch_gets_tensors(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    root = store(tmp_path / "set", splits=("train", "test"))
    for data in (root, str(root), vb.Dataset(root)):
        tensors = vb.torch_dataset(data, "test")
        assert isinstance(tensors, torch.utils.data.Dataset)
        assert len(tensors) == 6
    for tensor, array in zip(tensors, arrays(root, "test"), strict=True):
        assert tensor["image"].dtype == torch.float32
        assert np.array_equal(tensor["image"].numpy(), array["image"])
        assert tensor["labels"]["force_n"].item() == array["labels"]["force_n"]
        assert tensor["labels"]["contact"].dtype == torch.bool


@pytest.mark.parametrize("start", ["none", "fork", "spawn"])
@pytest.mark.parametrize("raw", [False, True])
def test_pytorch_loads_batches(tmp_path: Path, start: str, raw: bool) -> None:
    torch = pytest.importorskip("torch")
    root = store(tmp_path / "set", bits=16)
    workers: dict[str, Any] = (
        {"num_workers": 2, "multiprocessing_context": start} if start != "none" else {}
    )
    loader = torch.utils.data.DataLoader(
        vb.torch_dataset(root, raw=raw), batch_size=5, shuffle=True, **workers
    )
    expected = {record["frame_id"]: record["image"] for record in arrays(root, raw=raw)}
    for _epoch in range(2):
        names = []
        for batch in loader:
            assert batch["image"].dtype == (torch.uint16 if raw else torch.float32)
            names += batch["frame_id"]
            for name, image in zip(batch["frame_id"], batch["image"], strict=True):
                assert np.array_equal(image.numpy(), expected[name])
            assert batch["labels"]["x_c_mm"].shape == batch["readings"]["motor_angle_deg"].shape
        assert sorted(names) == sorted(expected)
