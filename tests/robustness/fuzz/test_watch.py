"""What a case does outside of its folder is noticed."""

import pickle
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.robustness.fuzz.watch import Watch, changes, listing


@pytest.fixture(scope="module")
def watch() -> Watch:
    return Watch(())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "case").mkdir()
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret").write_text("x", encoding="utf-8")
    return tmp_path / "case"


def _write(path: Path) -> None:
    path.write_text("y", encoding="utf-8")


def _bind() -> None:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))


FORBIDDEN: dict[str, Callable[[Path], object]] = {
    "open for writing": lambda outside: _write(outside / "new"),
    "open for reading": lambda outside: (outside / "secret").read_text(encoding="utf-8"),
    "os.remove": lambda outside: (outside / "secret").unlink(),
    "os.rename": lambda outside: (outside / "secret").rename(outside / "other"),
    "os.mkdir": lambda outside: (outside / "folder").mkdir(),
    "os.symlink": lambda outside: (outside / "link").symlink_to("secret"),
    "subprocess.Popen": lambda _: subprocess.run([sys.executable, "--version"], check=True),
    "socket.bind": lambda _: _bind(),
    "pickle.find_class": lambda _: pickle.loads(pickle.dumps(Path)),
}


@pytest.mark.parametrize("event", FORBIDDEN)
def test_what_is_done_outside_is_noticed(event: str, watch: Watch, folder: Path) -> None:
    with watch.confined(folder) as events:
        FORBIDDEN[event](folder.parent / "outside")
    assert any(one.startswith(f"{event}: ") for one in events)


def test_what_is_done_in_the_folder_is_allowed(watch: Watch, folder: Path) -> None:
    with watch.confined(folder) as events:
        _write(folder / "new")
        (folder / "new").rename(folder / "other")
        (folder / "other").read_text(encoding="utf-8")
        (folder / "other").unlink()
    assert events == []
    _write(folder.parent / "outside" / "later")  # nothing is watched between cases
    assert events == []


def test_a_way_out_through_a_link_is_noticed(watch: Watch, folder: Path) -> None:
    (folder / "link").symlink_to(folder.parent / "outside")
    with watch.confined(folder) as events:
        _write(folder / "link" / "new")
    assert len(events) == 1


def test_files_that_compiled_code_writes_are_found_by_comparison(folder: Path) -> None:
    outside = folder.parent / "outside"
    before = listing(outside)
    assert changes(before, listing(outside)) == []
    # Another program: this process's watch does not notice it.
    script = "from pathlib import Path; Path('secret').write_text('z'); Path('new').touch()"
    subprocess.run([sys.executable, "-c", script], cwd=outside, check=True)
    assert changes(before, listing(outside)) == [
        f"new: {outside / 'new'}",
        f"changed: {outside / 'secret'}",
    ]
