"""numba's `njit`, which keeps compiled code in one folder per state of the compiled sources.

By itself numba compares only the file in which a function is defined, and would use outdated code
after a change of another file whose functions it calls. All modules import `njit` from here, so
that the folder is set before the first function is decorated.
"""

import hashlib
import os
import shutil
from pathlib import Path

from numba import config, njit

__all__ = ["njit"]


def _set_folder(package: Path) -> None:
    """Name numba's folder after the compiled sources of `package`, and remove older folders.

    Change nothing if the user has chosen a folder, or if `package` is not writable.
    """
    cache, settings = package / "__pycache__", vars(config)
    if settings["CACHE_DIR"] or not os.access(package, os.W_OK):
        return
    sources = [path.read_bytes() for path in sorted(package.rglob("*.py"))]
    compiled = b"".join(source for source in sources if b"@njit" in source)
    state = hashlib.sha256(compiled).hexdigest()[:12]
    folder = cache / f"compiled-{state}"
    if not folder.is_dir():
        for old_folder in cache.glob("compiled-*"):
            shutil.rmtree(old_folder, ignore_errors=True)
    settings["CACHE_DIR"] = str(folder)


_set_folder(Path(__file__).parent.parent)
