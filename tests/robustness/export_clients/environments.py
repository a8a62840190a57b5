"""Environments of the client libraries, with pinned versions, apart from this project's own."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError, truncated
from solver.instrument.safe_path import PYTHON

HERE: Final = Path(__file__).parent


class Environment(NamedTuple):
    """A Python with client libraries: its interpreter and its list of versions."""

    python: Path
    requirements: Path


def environment(name: str, folder: Path) -> Environment:
    """Create the environment `name`, or use the one that exists with the same versions.

    `name` is that of `<name>.txt` in this folder, which lists every package, so that none is
    resolved. Packages come from the index that pip is configured for. Raises InputError if an
    installation fails.
    """
    requirements = HERE / f"{name}.txt"
    root = folder / name
    python = root / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    stamp, versions = root / "installed", hashlib.sha256(requirements.read_bytes()).hexdigest()
    if not (stamp.is_file() and stamp.read_text(encoding="utf-8") == versions):
        install = [str(python), "-P", "-m", "pip", "install", "--quiet", "--no-deps"]
        for command in (
            [*PYTHON, "-m", "venv", "--clear", str(root)],
            [*install, "--requirement", str(requirements)],
        ):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise InputError(f"{root}: cannot be installed ({truncated(done.stderr)})")
        stamp.write_text(versions, encoding="utf-8")
    return Environment(python, requirements)


def offline(home: Path) -> dict[str, str]:
    """Return environment variables under which Hugging Face's libraries use no network."""
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "SYSTEMROOT") if name in os.environ}
    return {
        **kept,
        "HOME": str(home),
        "HF_HOME": str(home / "hugging_face"),
        **dict.fromkeys(("HF_HUB_OFFLINE", "HF_DATASETS_OFFLINE", "TRANSFORMERS_OFFLINE"), "1"),
    }
