"""What can be wrong with what a user hands over."""

from typing import Final

# Chosen: two lines of a terminal tell which value is meant.
LONGEST_SHOWN: Final = 160


class InputError(Exception):
    """A file, key or value that cannot be used; its text is one sentence for the user.

    Raise this when the mistake lies outside the program and the user can mend it: the
    command lines print the sentence and exit with status 2.
    """


class DamageError(InputError):
    """A file of a generated dataset that is missing, or is not what was written."""


def shown(value: object) -> str:
    """Quote a value in a message: on one line, the end of a long one left out."""
    return cut(repr(value))


def cut(text: str) -> str:
    """Put a text on one line, and leave out the end of a long one."""
    line = " ".join(text[: 2 * LONGEST_SHOWN].split())
    return line if len(text) <= LONGEST_SHOWN else f"{line[:LONGEST_SHOWN]}..."
