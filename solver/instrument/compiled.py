"""Where compiled code is kept: one folder for every state of the sources that are compiled.

numba looks only at the file that a function stands in, and would go on using what it compiled
when a function that this one calls has changed in another file.
"""

import hashlib
import os
import shutil
from pathlib import Path

_VARIABLE = "NUMBA_CACHE_DIR"


def keep_apart(package: Path) -> None:
    """Tell numba of a folder that is named after the sources of `package`, and drop older ones.

    Must run before numba is imported. Nothing is changed where the user has chosen a folder, or
    where none can be written.
    """
    cache = package / "__pycache__"
    if os.environ.get(_VARIABLE) or not os.access(package, os.W_OK):
        return
    sources = [path.read_bytes() for path in sorted(package.rglob("*.py"))]
    compiled = b"".join(source for source in sources if b"@njit" in source)
    state = hashlib.sha256(compiled).hexdigest()[:12]
    folder = cache / f"compiled-{state}"
    if not folder.is_dir():
        for older in cache.glob("compiled-*"):
            shutil.rmtree(older, ignore_errors=True)
    os.environ[_VARIABLE] = str(folder)
