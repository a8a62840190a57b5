"""Copies of a valid dataset whose files are replaced, with hashes as a sender would state them."""

import json
import shutil
from pathlib import Path
from typing import Final

from solver.instrument.hashes import HASHES, digest, parse_hashes

# Files of a dataset that are not needed to read it.
_LEFT_OUT: Final = ("report", ".lock")


def copied(source: Path, target: Path) -> Path:
    """Copy a dataset or collection without its report; return the target."""
    shutil.copytree(source, target, ignore=shutil.ignore_patterns(*_LEFT_OUT))
    return target


def replaced(root: Path, path: Path, data: bytes, *, sealed: bool = True) -> None:
    """Replace a file of a dataset; if `sealed`, state its new hash wherever the old one is."""
    path.write_bytes(data)
    changed = path
    while sealed and changed.parent != root.parent:
        for folder in changed.parents[:2]:
            if folder / HASHES != changed and _restate(folder / HASHES, changed):
                changed = folder / HASHES
                break
        else:
            return


def _restate(hashes: Path, changed: Path) -> bool:
    """Replace the hash of a file in a hashes.json; return whether it lists the file."""
    if not hashes.is_file():
        return False
    table = parse_hashes(hashes.read_bytes()) or {}
    name = changed.relative_to(hashes.parent).as_posix()
    if name not in table:
        return False
    table[name] = digest(changed.read_bytes())
    hashes.write_text(json.dumps(table, indent=0) + "\n", encoding="utf-8")
    return True
