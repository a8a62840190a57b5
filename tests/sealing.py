"""Hashes of a dataset that a test has changed on purpose."""

from pathlib import Path

from solver.instrument.files import sha256, write_bytes
from solver.instrument.hashes import HASHES, hashes_bytes
from vbaa_bench.dataset.layout import Layout


def reseal(layout: Layout) -> None:
    """Record what lies in both trees now as what was generated."""
    for tree in layout.trees:
        for folder in (*sorted(tree.glob("shard_*")), tree):
            (folder / HASHES).unlink(missing_ok=True)
            named = {path: path.relative_to(folder).as_posix() for path in _files(folder)}
            table = {name: sha256(path) for path, name in named.items()}
            write_bytes(folder / HASHES, hashes_bytes(table))


def _files(folder: Path) -> list[Path]:
    """Files of a shard; of a tree those outside shards, and the hashes of its shards."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return [
        path
        for path in files
        if path.parent == folder or path.name == HASHES or "shard_" not in path.parent.name
    ]
