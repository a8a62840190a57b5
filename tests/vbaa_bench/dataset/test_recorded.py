"""Files of results are recorded when they are written, and checked when they are read."""

import threading
from pathlib import Path

import polars as pl
import pytest

from solver.instrument import files as writing
from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import HASHES, read_bytes, read_hashes
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.lock import locked
from vbaa_bench.dataset.recorded import check_none_missing, exists, write_recorded


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_file_is_checked_from_the_moment_it_is_written(tmp_path: Path) -> None:
    write_recorded(tmp_path, {"a.csv": b"1", "b.csv": b"2"})
    write_recorded(tmp_path, {"b.csv": b"3", "c.csv": b"4"}, removed=["a.csv"])
    assert names(tmp_path) == {"b.csv", "c.csv", HASHES}
    assert set(read_hashes(tmp_path) or {}) == {"b.csv", "c.csv"}
    assert read_bytes(tmp_path / "b.csv") == b"3"
    (tmp_path / "b.csv").write_bytes(b"2")
    with pytest.raises(DamageError, match=r"b\.csv: is not what was generated"):
        read_bytes(tmp_path / "b.csv")
    (tmp_path / "b.csv").rename(tmp_path / "mine.csv")
    assert exists(tmp_path / "mine.csv")  # a user's own file, read without a check
    with pytest.raises(DamageError, match=r"b\.csv: is missing; run the command"):
        check_none_missing(tmp_path)
    write_recorded(tmp_path, {"b.csv": b"5"})
    check_none_missing(tmp_path)


def test_a_full_disk_keeps_all_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_recorded(tmp_path, {"a.csv": b"1", "b.csv": b"2"})
    write, count = writing.write_bytes, 0

    def full(path: Path, data: bytes) -> None:
        nonlocal count
        count += 1
        if count == 3:
            raise OSError(28, "No space left on device")
        write(path, data)

    monkeypatch.setattr("vbaa_bench.dataset.recorded.write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        write_recorded(tmp_path, {"a.csv": b"3", "b.csv": b"4"})
    assert names(tmp_path) == {"a.csv", "b.csv", HASHES}
    assert [read_bytes(tmp_path / name) for name in ("a.csv", "b.csv")] == [b"1", b"2"]


def test_a_kill_between_hashes_and_files_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_recorded(tmp_path, {"a.csv": b"1", "b.csv": b"2"})
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", _killed_at("a.csv", Path.replace))
        with pytest.raises(KeyboardInterrupt):
            write_recorded(tmp_path, {"a.csv": b"3", "b.csv": b"4"})
    for name in ("a.csv", "b.csv"):
        with pytest.raises(DamageError):
            read_bytes(tmp_path / name)


def _killed_at(name: str, replace: object) -> object:
    def killed(source: Path, target: Path) -> Path:
        if target.name == name:
            raise KeyboardInterrupt
        return replace(source, target)  # type: ignore[operator, no-any-return]

    return killed


def test_writers_of_one_folder_wait_for_each_other(tmp_path: Path) -> None:
    threads = [
        threading.Thread(target=write_recorded, args=(tmp_path, {f"{number}.csv": b"1"}))
        for number in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(read_hashes(tmp_path) or {}) == {f"{number}.csv" for number in range(8)}
    assert names(tmp_path) == {*(f"{number}.csv" for number in range(8)), HASHES}


def test_a_lock_is_waited_for_in_vain(tmp_path: Path) -> None:
    with (
        locked(tmp_path / ".lock"),
        pytest.raises(InputError, match="is being written by process"),
        locked(tmp_path / ".lock", wait_s=0.02),
    ):
        pass


def test_a_collection_misses_its_rigs(tmp_path: Path) -> None:
    layout = CollectionLayout(tmp_path)
    layout.write_scene({"title": "two"}, {})
    layout.write_rows({0: {"rig": "0", "reason": "too stiff"}, 1: {"rig": "1", "reason": None}})
    layout.rig(1).observations.mkdir(parents=True)
    with pytest.raises(DamageError, match="rig_00001: is missing or incomplete"):
        layout.rigs()
    layout.rig(1).hashes.write_text("{}")
    assert set(layout.rigs()) == {1}
    table = pl.read_csv(layout.table).write_csv().replace("too", "two")
    layout.table.write_text(table)
    with pytest.raises(DamageError, match=r"rigs\.csv: is not what was generated"):
        layout.rigs()
