"""Tables of hashes are read once, and again after a change."""

import json
from pathlib import Path

import pytest

from solver.instrument.errors import DamageError
from solver.instrument.files import write_bytes
from solver.instrument.hashes import (
    HASHES,
    MAX_NAME,
    digest,
    hashes_bytes,
    parse_hashes,
    read_bytes,
    read_hashes,
)


def test_a_changed_table_is_read_again(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"first")
    table = {"a": digest(b"first")}
    write_bytes(tmp_path / HASHES, json.dumps(table).encode())
    assert read_bytes(tmp_path / "a") == b"first"
    read = read_hashes(tmp_path)
    assert read == table
    assert read is not None
    read.clear()  # a copy: the next reader has the whole table
    assert read_hashes(tmp_path) == table
    (tmp_path / "a").write_bytes(b"other")
    with pytest.raises(DamageError, match="is not what was generated"):
        read_bytes(tmp_path / "a")
    write_bytes(tmp_path / HASHES, json.dumps({"a": digest(b"other")}).encode())
    assert read_bytes(tmp_path / "a") == b"other"
    (tmp_path / HASHES).unlink()
    assert read_hashes(tmp_path) is None


def test_every_change_of_a_table_is_noticed() -> None:
    table = {"b.csv": digest(b"1"), "a.csv": digest(b"2")}
    data = hashes_bytes(table)
    assert parse_hashes(data) == table
    assert json.loads(data).keys() == {HASHES, "a.csv", "b.csv"}
    for place in range(len(data)):
        for changed in (
            data[:place],
            data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :],
            data[:place] + b" " + data[place + 1 :],
        ):
            if changed != data:
                assert parse_hashes(changed) is None


@pytest.mark.parametrize("name", ["a" * (MAX_NAME + 1), "a\ud800", "a\n", "../a", "/a"])
def test_names_that_no_dataset_has_are_refused(name: str) -> None:
    assert parse_hashes(json.dumps({"b.csv": digest(b"1"), name: digest(b"2")}).encode()) is None
