"""The connection of a worker and its supervisor: messages, and times stamped by the kernel.

Messages are lines of JSON over a socket. A worker runs code of others, which may write anything, at
any time. The supervisor therefore accepts a message only in its turn, of its form, and of the frame
that it waits for.

A supervisor that reads its own clock when a message arrives measures also how long it has waited
for a processor: 1.6 ms in the median with nine busy processes a core (measured). The kernel stamps
a packet in the call that sends it, and the sender cannot alter the stamp, so that the time between
two packets does not depend on the receiver.
"""

import json
import math
import os
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from solver.instrument.estimate import Assumption, Outcome
from solver.lab.table import COLUMNS
from vbaa_bench.scoring.information_sets import SETS

# Length limits of texts [characters]. Chosen: a message is one cell of a table, a traceback one
# page; a method may send megabytes.
MAX_MESSAGE: Final = 1000
MAX_TRACEBACK: Final = 8000
# Longest line [bytes]. Chosen: twice all texts, of which JSON writes a character in 12 bytes.
_MAX_LINE: Final = 1 << 18
# The columns of a row that are texts; all others are numbers.
TEXTS: Final = ("frame_id", "outcome", "message", "assumption")
# Interval at which a silent worker is looked at [s]. Chosen: what it allocates in between is less
# than 1 GB.
TICK_S: Final = 0.1
# Linux's option of sockets, whose messages hold a struct timespec; Python does not name it.
_SO_TIMESTAMPNS: Final = 35
_TIMESPEC: Final = struct.Struct("@ll")

Message = dict[str, Any]


class MessageError(Exception):
    """Error for a message that is not what the supervisor waits for; its text is the reason."""


class WorkerEnd:
    """The worker's end of the connection, and that of its stamps, where there are any."""

    def __init__(self, connection: socket.socket, stamps: socket.socket | None) -> None:
        self._connection, self._stamps = connection, stamps

    def send(self, kind: str, **values: Any) -> None:
        """Send one message."""
        self._connection.sendall(json.dumps({"kind": kind, **values}).encode() + b"\n")

    @contextmanager
    def timed(self, what: str) -> Iterator[None]:
        """Let the supervisor's clocks measure this block."""
        self.send("start", what=what)
        self._wait()
        self._stamp()
        yield
        self._stamp()
        self.send("stop")
        self._wait()

    def _stamp(self) -> None:
        if self._stamps is not None:
            self._stamps.send(b"")

    def _wait(self) -> None:
        if not self._connection.recv(1):
            os._exit(1)  # the supervisor has ended


class Stamps:
    """The receiver's end of a pair of sockets, and the end for the process that is timed.

    `sender` is None on systems other than Linux, where nothing is stamped.
    """

    def __init__(self) -> None:
        self.sender: socket.socket | None = None
        if sys.platform == "linux":
            self._receiver, self.sender = socket.socketpair(type=socket.SOCK_DGRAM)
            self._receiver.setblocking(False)
            self._receiver.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)

    def read(self) -> list[int]:
        """Return when each packet so far was sent [ns]; those without a stamp are left out."""
        times = list[int]()
        while self.sender is not None:
            try:
                _, stamps, _, _ = self._receiver.recvmsg(1, socket.CMSG_SPACE(_TIMESPEC.size))
            except BlockingIOError:
                break
            for _, _, data in stamps:
                seconds, nanoseconds = _TIMESPEC.unpack(data[: _TIMESPEC.size])
                times.append(seconds * 10**9 + nanoseconds)
        return times

    def close(self) -> None:
        """Close both ends."""
        if self.sender is not None:
            self._receiver.close()
            self.sender.close()


class SupervisorEnd:
    """The supervisor's end of the connection.

    `has_ended` is called every TICK_S while nothing arrives; it tests whether the worker has ended.
    """

    def __init__(self, connection: socket.socket, has_ended: Callable[[], bool]) -> None:
        self._connection, self._has_ended, self._text = connection, has_ended, b""

    def receive(self, deadline: float, *kinds: str) -> Message:
        """Wait until `deadline` of the monotonic clock for a message of one of these kinds.

        Raises TimeoutError; EOFError if the worker has ended or closed the connection;
        MessageError.
        """
        ended = False
        while b"\n" not in self._text:
            remaining = deadline - time.monotonic()
            if remaining <= 0:
                raise TimeoutError
            self._connection.settimeout(min(TICK_S, remaining))
            try:
                part = self._connection.recv(1 << 16)
            except TimeoutError:
                if ended:  # and what it sent last has been read
                    raise EOFError from None
                ended = self._has_ended()
                continue
            except OSError as error:
                raise EOFError from error
            if not part:
                raise EOFError
            self._text += part
            if len(self._text) > _MAX_LINE:
                raise MessageError(f"of more than {_MAX_LINE} bytes")
        line, _, self._text = self._text.partition(b"\n")
        message = _parsed(line)
        if message.get("kind") not in kinds:
            raise MessageError("out of turn")
        return message

    def answer(self) -> None:
        """Let the worker go on. Raises EOFError; MessageError if it has not waited."""
        if self._text:
            raise MessageError("out of turn")
        try:
            self._connection.sendall(b"\n")
        except OSError as error:
            raise EOFError from error

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def frame_of(message: Message, remaining: set[int]) -> int:
    """Return the frame that a worker begins, which must be one of those left.

    Raises MessageError.
    """
    index = message.get("index")
    if type(index) is not int or index not in remaining:
        raise MessageError("of a frame that it was not given")
    return index


def checked_row(message: Message, index: int, frame_id: str) -> Message:
    """Return a frame's message if all its values are of their form. Raises MessageError."""
    row = message.get("row")
    if not isinstance(row, dict) or row.keys() != set(COLUMNS):
        raise MessageError("without the columns of a row")
    if message.get("index") != index or row["frame_id"] != frame_id:
        raise MessageError("of another frame")
    if row["outcome"] not in list(Outcome) or not is_text(row["message"], 2 * MAX_MESSAGE):
        raise MessageError("without an outcome")
    faults = message.get("faults")
    if (
        not all(is_number_or_none(row[name]) for name in COLUMNS if name not in TEXTS)
        or not is_number_or_none(message.get("peak_mb"))
        or not is_text(message.get("traceback"), 2 * MAX_TRACEBACK)
        or row["assumption"] not in [None, *Assumption]
        or message.get("information") not in ["", *SETS]
        or not isinstance(faults, list)
        or not all(is_text(fault, MAX_MESSAGE) for fault in faults)
    ):
        raise MessageError("with a value of another type")
    return message


def is_text(value: object, max_length: int) -> bool:
    """Test whether a value is a text that UTF-8 can represent, not longer than `max_length`."""
    if not isinstance(value, str) or len(value) > max_length:
        return False
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


def is_number_or_none(value: object) -> bool:
    """Test whether a value is None or a number that is finite in double precision."""
    if value is None:
        return True
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond a float's range
        return False


def _parsed(line: bytes) -> Message:
    try:
        message: object = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise MessageError("that is not JSON") from error
    if not isinstance(message, Mapping):
        raise MessageError("that is not a JSON object")
    return dict(message)
