"""Files are moved into place, also where another process has them open for a moment."""

from pathlib import Path

import pytest

from solver.instrument import files


@pytest.mark.parametrize("refusals", [0, 3])
def test_a_rename_that_windows_refuses_for_a_moment_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refusals: int
) -> None:
    replace, refused = Path.replace, list[Path]()

    def refusing(source: Path, target: Path) -> Path:
        if len(refused) < refusals:
            refused.append(target)
            raise PermissionError(13, "Access is denied")
        return replace(source, target)

    monkeypatch.setattr(Path, "replace", refusing)
    monkeypatch.setattr(files, "_IS_WINDOWS", True)
    files.write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "new"
    assert len(refused) == refusals
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("is_windows", [False, True])
def test_a_rename_that_stays_refused_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_windows: bool
) -> None:
    def refusing(_source: Path, _target: Path) -> Path:
        raise PermissionError(13, "Access is denied")

    monkeypatch.setattr(Path, "replace", refusing)
    monkeypatch.setattr(files, "_IS_WINDOWS", is_windows)
    monkeypatch.setattr(files, "_MAX_REFUSED_S", 0.05)
    with pytest.raises(PermissionError):
        files.write_text(tmp_path / "a.txt", "new")
    assert not list(tmp_path.iterdir())
