"""Parquet files with metadata that pyarrow, and all libraries on top of it, can read."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.files import write_bytes

# Polars stores its own Arrow schema, without our metadata, and pyarrow prefers it to the metadata
# of the file. Under another key of the same length it is ignored.
_ARROW_SCHEMA: Final = b"ARROW:schema"
_IGNORED: Final = b"POLAR:schema"
_TAIL: Final = 8  # bytes after the footer: its length, and the signature PAR1
# Chosen: readers fetch a group at once, and viewers advise 100 rows with images.
GROUP_ROWS: Final = 100


def write_parquet(path: Path, table: pl.DataFrame, metadata: Mapping[str, Any]) -> None:
    """Write a table with JSON metadata by key, atomically. Raises OSError."""
    stream = io.BytesIO()
    texts = {key: json.dumps(value) for key, value in metadata.items()}
    # zstd at its lowest level: images do not get smaller.
    table.write_parquet(
        stream, compression="zstd", compression_level=1, row_group_size=GROUP_ROWS, metadata=texts
    )
    data = stream.getbuffer()
    footer = int.from_bytes(data[-_TAIL : -_TAIL // 2], "little")
    begin = len(data) - _TAIL - footer
    data[begin:-_TAIL] = bytes(data[begin:-_TAIL]).replace(_ARROW_SCHEMA, _IGNORED)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, bytes(data))


def image_column(name: str, images: list[tuple[str, bytes]]) -> pl.Series:
    """Make a column of images from their file names and bytes, as Hugging Face stores it."""
    values = [{"bytes": data, "path": file_name} for file_name, data in images]
    return pl.Series(name, values, dtype=pl.Struct({"bytes": pl.Binary(), "path": pl.String()}))


def features(table: Mapping[str, pl.DataType]) -> dict[str, Any]:
    """Describe columns as the features of a Hugging Face dataset; a struct is an image."""
    return {"info": {"features": {name: _feature(dtype) for name, dtype in table.items()}}}


# Names of types in Hugging Face's features, and in LeRobot's.
TYPE_NAMES: Final = {
    pl.String(): "string",
    pl.Float64(): "float64",
    pl.Float32(): "float32",
    pl.Int64(): "int64",
    pl.Boolean(): "bool",
}


def _feature(dtype: pl.DataType) -> dict[str, Any]:
    match dtype:
        case pl.Struct():
            return {"_type": "Image"}
        case pl.List():
            return {"feature": {"dtype": "float64", "_type": "Value"}, "_type": "Sequence"}
    return {"dtype": TYPE_NAMES[dtype], "_type": "Value"}
