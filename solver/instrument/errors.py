"""Exceptions for unusable input, and short texts for messages about errors."""

import difflib
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

# Chosen: two lines of a terminal are enough to identify a value.
LONGEST_SHOWN: Final = 160
# First characters of a formula in spreadsheets.
_FORMULA: Final = ("=", "+", "-", "@")


class InputError(Exception):
    """Error for a file, key or value that cannot be used; its text is one sentence for the user.

    Raise this if the mistake is outside the program and the user can correct it: the
    command lines print the sentence and exit with status 2. Characters that would control a
    terminal, or cannot be encoded, are escaped: the text may quote a file of unknown origin.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


class IncompleteError(InputError):
    """Error for a source of images that ends too early: what it gave was used, the exit is 1."""


class DamageError(InputError):
    """Error for a file of a generated dataset that is missing, or is not what was written."""


def printable(text: str) -> str:
    """Escape the characters of a text that would control a terminal, or cannot be encoded."""
    return "".join(map(_printable, text))


def _printable(character: str) -> str:
    if character.isprintable() or character == "\n":
        return character
    return repr(character)[1:-1]


def cell_text(text: str) -> str:
    """Make a text of unknown origin, such as a method's message, fit for a cell of a CSV file.

    It is on one line, without characters that control a terminal. A spreadsheet would compute a
    text that begins as a formula, such as =HYPERLINK(...): an apostrophe is put before it.
    """
    line = printable(" ".join(text.split()))
    return f"'{line}" if line.startswith(_FORMULA) else line


def quoted(value: object) -> str:
    """Quote a value for a message: on one line, a long value truncated."""
    try:
        return truncated(repr(value))
    except (RecursionError, ValueError):  # too deep, or a whole number of more than 4300 digits
        return f"of type {type(value).__name__}, and too large to be shown"


def truncated(text: str) -> str:
    """Put a text on one line, and truncate a long text."""
    line = " ".join(text[: 2 * LONGEST_SHOWN].split())
    return line if len(text) <= LONGEST_SHOWN else f"{line[:LONGEST_SHOWN]}..."


def suggestion(name: str, known: Iterable[str]) -> str:
    """Suggest the known name that is meant by an unknown one, or list the known ones."""
    names = list(dict.fromkeys(known))
    similar = similar_name(name, names)
    return f"did you mean {similar}?" if similar else f"known are {', '.join(names)}"


def similar_name(name: str, known: Sequence[str]) -> str | None:
    """Return the known name that is meant by an unknown one; None if there is no similar one."""
    similar = difflib.get_close_matches(truncated(name), known, n=1, cutoff=0.7)
    return similar[0] if similar else None


def described(error: BaseException) -> str:
    """Describe an error in a program in one line: kind, message, and where it was raised."""
    text = f"{type(error).__name__}: {error}"
    places = traceback.extract_tb(error.__traceback__)
    return f"{text} ({Path(places[-1].filename).name}:{places[-1].lineno})" if places else text
