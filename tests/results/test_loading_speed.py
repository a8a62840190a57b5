"""The page of loading speed; with PyTorch, its measurements."""

import sys
from pathlib import Path

import pytest

from results.loading_speed import measure as speed_loading
from results.loading_speed.measure import WAYS, measure, page
from solver.instrument.errors import InputError
from tests.vbaa_bench.stored import store


def test_the_page_has_a_row_per_dataset_and_way() -> None:
    way = {"first_epoch_s": 0.5, "images_per_s": 321.4, "processor_ms": 2.345}
    record = {
        "dataset": "small",
        "frames": 27,
        "image": "512 x 176 px, 8 bits",
        "opened_s": 0.05,
        "index_bytes_per_frame": 152.6,
        "torch": "2",
        "hash_ms": 0.123,
        "ways": {str(one): way for one in WAYS},
    }
    lines = page([record], "python -m results.loading_speed small").splitlines()
    assert "| small | 27 | 512 x 176 px, 8 bits | 0.05 | 153 | 2.35 | 0.12 |" in lines
    assert "| 2 workers, fork, checked | 321 (0.5) |" in lines
    assert sum(line.endswith("| 321 (0.5) |") for line in lines) == len(WAYS)


def test_pytorch_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"needs PyTorch, the extra '.\[torch\]'"):
        measure(tmp_path)


def test_every_way_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    monkeypatch.setattr(speed_loading, "WAYS", WAYS[:3])
    record = measure(store(tmp_path / "set", bits=16), seconds=0.05)
    assert (record["frames"], record["image"]) == (12, "12 x 8 px, 16 bits")
    assert set(record["ways"]) == {str(way) for way in WAYS[:3]}
    assert all(way["images_per_s"] > 0 for way in record["ways"].values())
