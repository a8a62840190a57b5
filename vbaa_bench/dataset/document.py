"""JSON documents: read, checked against a model, and compared.

A document comes with a dataset, which may be of anyone: a key that is missing, or has a value of
another type, would be a traceback far from its cause.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.hashes import read_bytes

# Largest number. Chosen: far beyond all results, of which sums of squares then do not overflow; a
# number of single precision holds it.
LARGEST: Final = 1e30
# Largest JSON document [bytes]. Chosen: ten times a baseline of 100,000 frames.
_MAX_BYTES: Final = 1 << 28
# Number of differences and of characters of a value that a message shows. Chosen: three lines of a
# terminal.
_SHOWN: Final = 5
_CHARACTERS: Final = 60
# A figure in any unit.
Figure = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
_Model = TypeVar("_Model", bound=BaseModel)


def read_json(path: Path) -> dict[str, Any]:
    """Read the object in a JSON file. Raises InputError if there is none, or it is too large."""
    try:
        document = json.loads(read_bytes(path, _MAX_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds {type(document).__name__}, allowed is a JSON object")
    return document


class Document(BaseModel):
    """Keys of a document that are read; it may have others."""

    model_config = ConfigDict(frozen=True, strict=True, extra="allow")


def check_document(path: Path, document: Mapping[str, Any], model: type[_Model]) -> _Model:
    """Check a document that was read from `path`; return it as its model.

    Raises InputError, which names the first key that is missing or wrong.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise InputError(mistake_sentence(path, error.errors()[0])) from error


def mistake_sentence(path: Path, mistake: Mapping[str, Any], *section: str) -> str:
    """Write one of pydantic's errors, in a section of a document, as a sentence."""
    name = truncated(".".join(map(str, (*section, *mistake["loc"]))))
    if mistake["type"] == "missing":
        return f"{path}: the key {name} is missing"
    value, reason = quoted(mistake["input"]), truncated(mistake["msg"])
    return f"{path}: {name} is {value}, which is not allowed ({reason})"


class Difference(NamedTuple):
    """Dotted key with different values in two documents; None is a missing key or null."""

    key: str
    old: Any
    new: Any

    def __str__(self) -> str:
        return f"{self.key} {_short(self.old)} -> {_short(self.new)}"


def differences(old: Any, new: Any, key: str = "") -> Iterator[Difference]:
    """Yield the keys at which two documents differ, sorted, with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for name in sorted(old.keys() | new.keys()):
            yield from differences(old.get(name), new.get(name), f"{key}.{name}".lstrip("."))
    elif old != new:
        yield Difference(key, old, new)


def as_in_file(document: Any) -> Any:
    """Convert a document as it is when read from a file: tuples become lists."""
    return json.loads(json.dumps(document))


def listing(texts: Sequence[object]) -> str:
    """Join the first texts with commas, followed by the number of further ones."""
    shown = ", ".join(map(str, texts[:_SHOWN]))
    return f"{shown} and {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else shown


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= _CHARACTERS else f"{text[: _CHARACTERS - 3]}..."
