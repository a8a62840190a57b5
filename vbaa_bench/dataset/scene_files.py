"""Files that a scene names, as a dataset or collection records them.

A dataset has copies of all files that its scene names or may draw, a collection those of all its
rigs. They are in the folder `files` beside identity.json or collection.json, which records their
sha256 and is written first. Everything is rendered from the copies, and a copy is compared with
its sha256 whenever it is read.
"""

import contextlib
import functools
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.files import open_regular, write_bytes
from solver.instrument.hashes import HASHES, digest, read_hashes
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.faults import file_fault
from vbaa_bench.dataset.layout import FILES
from vbaa_bench.scene.files import (
    MAX_BYTES,
    FileContent,
    Kind,
    NamedFile,
    SceneFileError,
    file_of_scene,
    name_in_dataset,
)
from vbaa_bench.scene.load import SceneFile

# What to do about a damaged copy.
_MEND: Final = "run the command that made it again, or verify with --repair and --scene"
# Documents that record the sha256 of the copies beside them, by their key `files`.
_DOCUMENTS: Final = ("identity.json", "collection.json")


class FileVersion(NamedTuple):
    """A file that a scene names, with what changes when it is written.

    `sha256` is the recorded one; None for a file that is not a dataset's copy.
    """

    path: Path
    written: tuple[int, ...]
    sha256: str | None


def file_version(folder: Path, name: str) -> FileVersion:
    """Find a file that a scene names in the folder of its files. Raises SceneFileError."""
    path = file_of_scene(folder, name)
    recorded = _recorded(folder)
    if recorded is not None and name_in_dataset(name) not in recorded:
        raise SceneFileError(f"{path}: is not a file that the dataset's scene names")
    sha256 = None if recorded is None else recorded[name_in_dataset(name)]
    try:
        return FileVersion(path, _written(path), sha256)
    except OSError as error:
        raise _unreadable(path, error, sha256) from error


def read_version(version: FileVersion, kind: Kind) -> FileContent:
    """Read a file of a scene, whose size is checked first. Raises SceneFileError."""
    path, largest = version.path, MAX_BYTES[kind]
    try:
        with open_regular(path) as stream:
            size = os.fstat(stream.fileno()).st_size
            data = stream.read() if size <= largest else b""
    except OSError as error:
        raise _unreadable(path, error, version.sha256) from error
    if size > largest:
        raise SceneFileError(f"{path}: has {size // 10**6} MB, allowed are {largest // 10**6} MB")
    if version.sha256 not in (None, digest(data)):
        raise SceneFileError(f"{path}: is not the file with which the dataset was made; {_MEND}")
    return FileContent(path, data)


def _unreadable(path: Path, error: OSError, sha256: str | None) -> SceneFileError:
    remedy = "" if sha256 is None else f"; {_MEND}"
    return SceneFileError(f"{path}: cannot be read ({error.strerror}){remedy}")


def read_file(folder: Path, name: str, kind: Kind) -> FileContent:
    """Read a file that a scene names in the folder of its files. Raises SceneFileError."""
    return read_version(file_version(folder, name), kind)


def file_digests(file: SceneFile) -> dict[str, str]:
    """Compute the sha256 of all files that a scene names or may draw, by their names in a dataset.

    They are sorted: a scene that is read from a record has its keys in another order. Raises
    SceneFileError, with the scene's key.
    """
    named = {name_in_dataset(one.name): one for one in file.named_files}
    return {name: digest(_content(file, one).data) for name, one in sorted(named.items())}


def copy_files(file: SceneFile, digests: Mapping[str, str], folder: Path) -> SceneFile:
    """Copy the files of a scene, whose sha256 are known, unless `folder` has them.

    Returns the scene with this folder in the place of its own. Raises SceneFileError for a file
    that has changed meanwhile, OSError if a copy cannot be written.
    """
    for named in file.named_files:
        name = name_in_dataset(named.name)
        if file_fault(folder / name, digests[name]) is None:
            continue
        content = _content(file, named)
        if digest(content.data) != digests[name]:
            raise SceneFileError(f"{content.path}: has changed while the command ran; repeat it")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(folder / name, content.data)
    return file.with_files_in(folder)


def check_copies(digests: Mapping[str, str], folder: Path) -> None:
    """Compare all copies with their sha256, at the end of a generation. Raises SceneFileError."""
    for name, recorded in digests.items():
        fault = file_fault(folder / name, recorded)
        if fault is not None:
            raise SceneFileError(f"{fault}; it has changed while the command ran, repeat it")


def _content(file: SceneFile, named: NamedFile) -> FileContent:
    try:
        return read_file(file.folder, named.name, named.kind)
    except SceneFileError as error:
        raise SceneFileError(file.message_at(named.key, str(error))) from error


def _recorded(folder: Path) -> Mapping[str, str] | None:
    """Look up the sha256 of the copies in a folder; None if it is not that of a dataset's copies.

    While a dataset is generated they are in its document only; in a finished one, where that is
    damaged, they are in its hashes.json as well.
    """
    if folder.name != FILES:
        return None
    for name in (*_DOCUMENTS, HASHES):
        with contextlib.suppress(OSError, InputError):
            return _read(folder.parent / name, _written(folder.parent / name))
    return None


@functools.lru_cache(maxsize=4)
def _read(document: Path, _version: tuple[int, ...]) -> Mapping[str, str]:
    if document.name == HASHES:
        table, prefix = read_hashes(document.parent) or {}, f"{FILES}/"
        copies = {n.removeprefix(prefix): one for n, one in table.items() if n.startswith(prefix)}
        if not copies:
            raise InputError(f"{document}: lists no copies")
        return copies
    files = read_json(document).get(FILES)
    if not isinstance(files, dict) or not all(isinstance(one, str) for one in files.values()):
        raise InputError(f"{document}: the key {FILES} is not an object of sha256 by names")
    return files


def _written(path: Path) -> tuple[int, ...]:
    """Return what changes when a file is written. Raises OSError."""
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns
