"""One fuzzed case: a kind of input, its valid material, and the verdict on an attempt."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from solver.instrument.errors import InputError

# From the requirement: no hang above 20 s, memory below 2 GB. Time is that of the processor, which
# does not depend on what else a machine does; a case that waits without computing is ended by the
# clock, at a limit that a loaded machine does not reach by computing.
TIME_LIMIT_S: Final = 20.0
CLOCK_LIMIT_S: Final = 100.0
MEMORY_LIMIT_MB: Final = 2000.0
# Chosen: a screenful; the longest proper message lists 20 mistakes.
MAX_MESSAGE: Final = 2000 + 20 * 80
MAX_LINE: Final = 2000
# What a message may name instead of a file: an option, or images that are used together.
_NAMED: Final = ("--", "rest images", "views", "the board", "rig.json")


class Case(NamedTuple):
    """A case: the name of its kind, and its number, of which its mistakes are a function."""

    kind: str
    number: int


class Result(NamedTuple):
    """Outcome of a case, one of OUTCOMES; its processor time, peak memory, message or finding."""

    outcome: str
    seconds: float
    memory_mb: float
    text: str = ""


# Allowed outcomes first; all others are findings.
# "noisy" is accepted or refused, and an image library has printed a line of its own about the file.
ALLOWED: Final = ("accepted", "refused", "noisy")
FINDINGS: Final = ("traceback", "hang", "memory", "died", "outside", "printed", "message")
OUTCOMES: Final = (*ALLOWED, *FINDINGS)


class Kind(Protocol):
    """A kind of input. It is constructed once for each process, with the folder of materials."""

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Write an input with mistakes into `folder`, and use it. Raises InputError."""


KindFactory = Callable[[Path], Kind]


class UnexpectedOutputError(Exception):
    """A command printed something that must not be printed."""


def verdict(action: Callable[[], None], *folders: Path) -> tuple[str, str]:
    """Run an action on files in `folders`; return the outcome and the message of an error.

    Exceptions other than InputError and UnexpectedOutputError are not caught.
    """
    try:
        action()
    except InputError as error:
        flaw = message_flaw(str(error), *folders)
        return ("message", f"{flaw}: {error}") if flaw else ("refused", str(error))
    except UnexpectedOutputError as error:
        return "printed", str(error)
    return "accepted", ""


def message_flaw(message: str, *folders: Path) -> str:
    """Return what is wrong with an error message, or an empty text.

    It must be printable and short, and name a file in one of `folders`, or an option.
    """
    lines = message.splitlines()
    if len(message) > MAX_MESSAGE or max(map(len, lines), default=0) > MAX_LINE:
        return f"the message has {len(message)} characters"
    if not message.strip():
        return "the message is empty"
    if unprintable := control_characters(message):
        return f"the message has the characters {unprintable!r}"
    if not any(name in message for name in (*map(str, folders), *_NAMED)):
        return "the message names no file"
    return ""


def control_characters(text: str) -> str:
    """Collect the characters of a text that control a terminal, or cannot be encoded."""
    allowed = "\n\t"
    return "".join(
        character
        for character in dict.fromkeys(text)
        if (character not in allowed and (ord(character) < 32 or 127 <= ord(character) < 160))
        or 0xD800 <= ord(character) < 0xE000
    )
