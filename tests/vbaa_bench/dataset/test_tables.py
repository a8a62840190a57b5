"""Tables of unknown origin are refused with a sentence, and known columns get their types."""

import io
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import InputError
from vbaa_bench.dataset.column import Kind
from vbaa_bench.dataset.tables import Schema, check_unique, checked, read_parquet

SCHEMA = Schema(
    kinds={
        "name": Kind.TEXT,
        "step": Kind.INTEGER,
        "x": Kind.NUMBER,
        "force": Kind.VECTOR,
        "hit": Kind.FLAG,
    },
    required=("name",),
    present=("x",),
    finite=("x",),
    together=("x", "force"),
)
TABLE = pl.DataFrame({"name": ["a", "b"], "x": [1.0, None], "force": [[1.0, 2.0, 3.0], None]})


def test_columns_without_values_get_their_types_and_others_are_kept() -> None:
    table = TABLE.with_columns(
        x=pl.lit(None), force=pl.lit(None), step=pl.lit(3, pl.UInt8), extra=pl.lit(b"x")
    )
    types = checked(table, SCHEMA, "t").schema
    assert [types[name] for name in ("x", "step", "extra")] == [
        pl.Float64(),
        pl.Int64(),
        pl.Binary(),
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (TABLE.drop("name"), "t: the column name is missing"),
        (TABLE.drop("x"), "t: the column x is missing"),
        (TABLE.with_columns(name=pl.lit(None)), "t: name is missing in a row"),
        (TABLE.with_columns(x=pl.lit("1")), "t: x holds String, allowed are numbers"),
        (TABLE.with_columns(name=pl.lit(1)), "t: name holds Int32, allowed are texts"),
        (TABLE.with_columns(step=pl.lit(1.5)), "step holds Float64, allowed are whole numbers"),
        (TABLE.with_columns(step=pl.lit(2**64 - 1, pl.UInt64)), "values of a wrong type"),
        (TABLE.with_columns(hit=pl.lit(1)), "t: hit holds Int32, allowed are true or false"),
        (TABLE.with_columns(x=pl.lit(float("inf"))), "t: x is not finite, or above .*, in a row"),
        (TABLE.with_columns(x=pl.lit(float("nan"))), "t: x is not finite, or above .*, in a row"),
        (TABLE.with_columns(x=pl.lit(-1e31)), r"t: x is not finite, or above 1e\+30, in a row"),
        (
            TABLE.with_columns(force=pl.lit(1.0)),
            "force holds Float64, allowed are vectors of three numbers",
        ),
        (
            TABLE.with_columns(force=pl.lit([1.0, 2.0, 3.0])),
            "allowed in a row are all or none of x",
        ),
        (TABLE.with_columns(x=1.0, force=pl.lit([1.0])), "force is not a vector of three numbers"),
        (
            TABLE.with_columns(x=1.0, force=pl.lit([1.0, float("nan"), 0.0])),
            "force is not a vector",
        ),
    ],
)
def test_wrong_tables_are_refused(change: pl.DataFrame, said: str) -> None:
    with pytest.raises(InputError, match=said):
        checked(change, SCHEMA, "t")


def test_repeated_names_and_damaged_bytes_are_refused() -> None:
    check_unique(TABLE, "name", "t")
    with pytest.raises(InputError, match="t: name 'a' occurs more than once"):
        check_unique(pl.concat([TABLE, TABLE.head(1)]), "name", "t")
    stream = io.BytesIO()
    TABLE.write_parquet(stream)
    assert read_parquet(Path("t"), stream.getvalue(), schema=SCHEMA).equals(TABLE)
    for data in (b"", stream.getvalue()[:-20]):
        with pytest.raises(InputError, match="t: is not a Parquet table"):
            read_parquet(Path("t"), data)


def test_a_panic_of_the_reader_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def panic(*_: object, **__: object) -> None:
        os.write(2, b"thread panicked; stack backtrace:")
        raise pl.exceptions.PanicException("assertion failed")

    monkeypatch.setattr(pl, "read_parquet", panic)
    data = io.BytesIO()
    pl.DataFrame({"a": [1.0]}).write_parquet(data)
    with pytest.raises(
        InputError, match=r"x\.parquet: is not a Parquet table \(assertion failed\)"
    ):
        read_parquet(Path("x.parquet"), data.getvalue())
    os.write(2, b"later")
    assert capfd.readouterr().err == "later"


def test_standard_error_is_there_after_several_threads_have_read(
    capfd: pytest.CaptureFixture[str],
) -> None:
    data = io.BytesIO()
    pl.DataFrame({"a": np.arange(1000.0)}).write_parquet(data)
    with ThreadPoolExecutor(8) as pool:
        read = [pool.submit(read_parquet, Path("x"), data.getvalue()) for _ in range(400)]
    assert all(one.result().height == 1000 for one in read)
    os.write(2, b"later")
    assert capfd.readouterr().err == "later"


def test_types_are_checked_before_any_value_is_read() -> None:
    """The values of the column are damaged, its type is not."""
    stream = io.BytesIO()
    TABLE.with_columns(x=pl.Series([{"a": 1}] * 2)).write_parquet(stream, compression="zstd")
    data = bytearray(stream.getvalue())
    data[4:60] = bytes(56)
    with pytest.raises(
        InputError, match=r"t: x holds Struct\(\{'a': Int64\}\), allowed are numbers"
    ):
        read_parquet(Path("t"), bytes(data), schema=SCHEMA)
