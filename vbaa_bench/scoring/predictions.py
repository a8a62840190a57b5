"""Tables of predictions: read from a file, checked and completed."""

import codecs
import difflib
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError, cell_text, truncated
from solver.instrument.estimate import Outcome
from solver.instrument.hashes import read_bytes
from solver.lab.table import COLUMNS
from vbaa_bench.dataset.recorded import exists
from vbaa_bench.dataset.tables import read_parquet
from vbaa_bench.scoring.scored_quantities import COMPONENTS, NUMBERS, SCORED_QUANTITIES

_TEXTS: Final = ("outcome", "message", "assumption", "information")
_KNOWN: Final = ("frame_id", *_TEXTS, *NUMBERS)
# Chosen: more unknown columns are counted, not named.
_MAX_NAMED: Final = 10
# Larger numbers count as missing. Chosen: far above any quantity in its unit.
_MAX_MAGNITUDE: Final = 1e12
# Largest predictions file. Chosen: a million frames of 40 columns in full precision have 1 GB.
MAX_FILE_BYTES: Final = 1 << 31
# Longest text in a cell [bytes]. Chosen: ten times the longest message that `solve` writes.
MAX_TEXT: Final = 10_000
# Characters that a message must not have in a table: see cell_text.
_UNFIT: Final = r"[\p{C}]|^\s*[=+\-@]"


def read_predictions(path: Path) -> pl.DataFrame:
    """Read predictions from CSV or Parquet; absent columns are added as null.

    The columns frame_id and one of x_c_mm and force_n are required. A missing `outcome` is
    "contact" if x_c_mm or force_n is given, else "crashed". Raises InputError.
    """
    return checked_predictions(parsed(read_file(path), path), str(path))


def read_file(path: Path) -> bytes:
    """Read a predictions file, and check it if it is recorded. Raises InputError."""
    try:
        if not exists(path):  # a pipe or a device may never end
            raise InputError(f"{path}: is not a CSV or Parquet table (there is no such file)")
        return read_bytes(path, MAX_FILE_BYTES)
    except OSError as error:
        raise InputError(f"{path}: is not a CSV or Parquet table ({error.strerror})") from error


def parsed(data: bytes, path: Path) -> pl.DataFrame:
    """Parse the bytes of a table: Parquet, or CSV with commas or with Excel's semicolons.

    All columns of a CSV are texts. Raises InputError.
    """
    if path.suffix.lower() == ".parquet":
        return read_parquet(path, data)
    try:
        text = data.removeprefix(codecs.BOM_UTF8)
        head = text.partition(b"\n")[0]
        separator = ";" if b";" in head and b"," not in head else ","
        return pl.read_csv(io.BytesIO(text), infer_schema=False, separator=separator)
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is not a CSV or Parquet table ({truncated(reason)})") from error


def checked_predictions(table: pl.DataFrame, source: str) -> pl.DataFrame:
    """Check and complete a table of predictions that was read from `source`. Raises InputError."""
    if "frame_id" not in table.columns:
        raise InputError(f"{source}: the column frame_id is missing")
    absent = [name for name in ("x_c_mm", "force_n") if name not in table.columns]
    if len(absent) == 2:
        raise InputError(
            f"{source}: the columns x_c_mm and force_n are both missing, one is required"
        )
    known = [name for name in (*NUMBERS, *_TEXTS) if name in table.columns]
    for name in [name for name in NUMBERS if name in known]:
        dtype = table[name].dtype
        if not (dtype.is_numeric() or dtype in (pl.String, pl.Null)):
            raise InputError(f"{source}: {name} holds {truncated(str(dtype))}, allowed are numbers")
    try:
        table = table.select(
            pl.col("frame_id").cast(pl.String),
            *(pl.col(n).cast(pl.String if n in _TEXTS else pl.Float64) for n in known),
        )
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"{source}: a column does not hold numbers ({truncated(reason)})"
        ) from error
    for name in ("frame_id", *(one for one in known if one in _TEXTS)):
        longest = int(table[name].str.len_bytes().max() or 0)  # type: ignore[arg-type]  # a number
        if longest > MAX_TEXT:
            raise InputError(
                f"{source}: {name} has a cell of {longest:,} bytes, allowed are {MAX_TEXT:,}"
            )
    if "message" in known and table["message"].str.contains(_UNFIT).any():
        message = pl.col("message").map_elements(cell_text, return_dtype=pl.String)
        table = table.with_columns(message)
    missing: list[pl.Expr] = [
        pl.lit(None, pl.String if n in _TEXTS else pl.Float64).alias(n)
        for n in (*NUMBERS, *_TEXTS)
        if n not in known
    ]
    table = table.with_columns(missing)
    # inf, NaN and absurdly large numbers count as missing.
    table = table.with_columns(
        pl.when(pl.col(name).abs() < _MAX_MAGNITUDE).then(pl.col(name)).alias(name)
        for name in NUMBERS
    )
    # A standard deviation that is not positive counts as missing.
    table = table.with_columns(
        pl.when(pl.col(quantity.sigma) > 0).then(pl.col(quantity.sigma)).alias(quantity.sigma)
        for quantity in (*SCORED_QUANTITIES, *COMPONENTS)
    )
    has_value = pl.col("x_c_mm").is_not_null() | pl.col("force_n").is_not_null()
    outcome = pl.col("outcome")
    contact, crashed = pl.lit(str(Outcome.CONTACT)), pl.lit(str(Outcome.CRASHED))
    return table.with_columns(
        outcome=pl.when(outcome.is_not_null())
        .then(outcome)
        .when(has_value)
        .then(contact)
        .otherwise(crashed)
    ).select("frame_id", *NUMBERS, *_TEXTS)


def unknown_columns(columns: Sequence[str], source: str) -> Iterator[str]:
    """Yield a sentence for each column that is not scored, with the known name nearest to it."""
    unknown = [name for name in columns if name not in _KNOWN and name not in COLUMNS]
    for name in unknown[:_MAX_NAMED]:
        near = difflib.get_close_matches(truncated(name), _KNOWN, n=1, cutoff=0.7)
        hint = f"; did you mean {near[0]}?" if near else ""
        yield f"{source}: the column {truncated(name)} is unknown and not scored{hint}"
    if len(unknown) > _MAX_NAMED:
        yield f"{source}: {len(unknown) - _MAX_NAMED} further columns are unknown and not scored"
