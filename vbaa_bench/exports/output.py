"""The folder of an export: written aside, part by part, and renamed when it is complete.

OUT is written as .OUT.part beside it. Its journal records every finished part, so that an
interrupted export continues; another dataset or other options begin again.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from solver.instrument.errors import InputError
from solver.instrument.files import move_into_place, sync_folder
from vbaa_bench.dataset.lock import locked

Record = dict[str, Any]
_JOURNAL: Final = ".journal.jsonl"


@dataclass
class Output:
    """Folder in which an export is written, and the records of its finished parts."""

    folder: Path
    records: list[Record] = field(default_factory=list)

    def finish_part(self, record: Record) -> None:
        """Record a part whose files are complete. Raises OSError."""
        with (self.folder / _JOURNAL).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(record) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
        self.records.append(record)

    def forget(self) -> None:
        """Begin again at the next call: the files are not what was exported. Raises OSError."""
        (self.folder / _JOURNAL).unlink(missing_ok=True)


def check_absent(out: Path) -> None:
    """Raise InputError if `out` exists, unless it is an empty folder."""
    if out.is_symlink() or (out.exists() and not (out.is_dir() and not any(out.iterdir()))):
        raise InputError(f"{out}: exists already; choose another folder with --out")


@contextlib.contextmanager
def export_folder(out: Path, identity: Record) -> Iterator[Output]:
    """Open the folder in which `out` is written; at the end without error, rename it to `out`.

    `identity` is all that the files depend on. Raises InputError if another process is writing it,
    and OSError if it cannot be written.
    """
    aside = out.with_name(f".{out.name}.part")
    aside.mkdir(parents=True, exist_ok=True)
    with locked(aside / ".lock"):
        records = _records(aside / _JOURNAL, identity)
        output = Output(aside, records[1:])
        if not records:
            _empty(aside)
            output.finish_part(identity)
            output.records.clear()
        yield output
        output.forget()
        sync_folder(aside)
    if out.exists():
        out.rmdir()
    move_into_place(aside, out)
    sync_folder(out.parent)


def _records(journal: Path, identity: Record) -> list[Record]:
    """Read a journal; empty if it is of another export. A line that was cut off is left out."""
    lines = journal.read_text(encoding="utf-8").splitlines(True) if journal.is_file() else []
    whole = [line for line in lines if line.endswith("\n")]
    try:
        records = [json.loads(line) for line in whole]
    except ValueError:
        return []
    if not records or records[0] != json.loads(json.dumps(identity)):
        return []
    if len(whole) < len(lines):
        journal.write_text("".join(whole), encoding="utf-8")
    return records


def _empty(folder: Path) -> None:
    """Remove what another export has left."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != ".lock":
            path.unlink()
