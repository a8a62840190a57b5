"""Differences of two JSON documents, as a short text."""

import json
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

# Number of differences and of characters of a value that a message shows. Chosen: three lines of a
# terminal.
_SHOWN: Final = 5
_CHARACTERS: Final = 60


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
