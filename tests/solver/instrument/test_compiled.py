"""The folder of compiled code depends on what the compiled functions do, not on its layout."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from solver.instrument import compiled
from solver.instrument.small_matrices import whitening

CONSTANTS = "LIMIT = 3\n"
FUNCTION = '''
from package.constants import LIMIT
from solver.instrument.compiled import njit


@njit
def limited(x):
    """Limit x."""
    return min(x, LIMIT)
'''


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that compiles functions, beside the one module of the solver that it needs."""
    instrument = tmp_path / "solver" / "instrument"
    instrument.mkdir(parents=True)
    shutil.copy(compiled.__file__, instrument)
    monkeypatch.setattr(compiled, "__file__", str(instrument / "compiled.py"))
    root = tmp_path / "package"
    root.mkdir()
    (root / "constants.py").write_text(CONSTANTS, encoding="utf-8")
    (root / "function.py").write_text(FUNCTION, encoding="utf-8")
    (root / "other.py").write_text("OTHER = 1\n", encoding="utf-8")
    return root


def folder(package: Path) -> str:
    return compiled._folder.__wrapped__(package)


@pytest.mark.parametrize(
    ("file", "old", "new", "same"),
    [
        ("function.py", '"""Limit x."""', '"""Return the smaller one."""  # of two', True),
        ("other.py", "1", "2", True),
        ("function.py", "min(", "max(", False),
        ("constants.py", "3", "4", False),
    ],
)
def test_only_code_that_is_compiled_changes_the_folder(
    package: Path, file: str, old: str, new: str, same: bool
) -> None:
    before = folder(package)
    text = (package / file).read_text(encoding="utf-8")
    assert old in text
    (package / file).write_text(text.replace(old, new), encoding="utf-8")
    assert (folder(package) == before) is same


def test_older_folders_are_removed_and_the_present_one_is_kept(package: Path) -> None:
    present = Path(folder(package))
    present.mkdir()
    assert Path(folder(package)).is_dir()
    (package / "constants.py").write_text("LIMIT = 5\n", encoding="utf-8")
    assert folder(package) != str(present)
    assert not present.exists()


def test_a_package_that_cannot_be_written_to_uses_numbas_own_folder(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everywhere
    assert folder(package) == ""


def test_the_syntax_trees_of_known_bytes_are_not_read_again(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = folder(package)
    monkeypatch.setattr(compiled, "syntax_digests", lambda *_: pytest.fail("parsed again"))
    assert folder(package) == before


def test_the_functions_on_the_disk_are_listed() -> None:
    assert whitening(np.eye(2)) == pytest.approx(np.eye(2))
    assert "small_matrices.whitening" in (compiled.compiled_functions() or ())


def test_functions_that_are_kept_elsewhere_are_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_CHOSEN", "")
    monkeypatch.setattr(compiled, "_folder", lambda _package: "")
    assert compiled.compiled_functions() is None


def test_without_a_folder_for_compiled_code_functions_are_compiled_and_it_is_said_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # A read-only package and no home: none of numba's ways to find a folder works.
    monkeypatch.setattr("numba.core.caching.CompileResultCacheImpl._locator_classes", [])
    monkeypatch.setattr(compiled, "_SETTINGS", dict(compiled._SETTINGS))
    compiled._say_not_kept.cache_clear()

    def doubled(x: float) -> float:
        return 2 * x

    functions = [compiled.njit(doubled) for _ in range(2)]
    assert [function(1.5) for function in functions] == [3.0, 3.0]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "set NUMBA_CACHE_DIR" in said
    compiled._say_not_kept.cache_clear()
