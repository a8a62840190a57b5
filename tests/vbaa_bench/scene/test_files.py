"""Files that a scene names are in its folder."""

from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.plan import plan
from vbaa_bench.scene.files import file_of_scene
from vbaa_bench.scene.load import load_scene


def test_files_below_the_folder_are_allowed(tmp_path: Path) -> None:
    assert file_of_scene(tmp_path, "meshes/a.stl") == tmp_path / "meshes" / "a.stl"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("../secret.stl", "is outside of the scene's folder"),
        ("/etc/passwd", "is outside of the scene's folder"),
        ("link.stl", "is outside of the scene's folder"),
        ("a\0b", "is not a file name"),
        ("a" * 251, "has 251 characters, allowed are 250"),
    ],
)
def test_files_outside_are_refused(tmp_path: Path, name: str, said: str) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    (tmp_path / "secret.stl").touch()
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    with pytest.raises(InputError, match=said):
        file_of_scene(folder, name)


@pytest.mark.parametrize(
    "section",
    [
        "object: {kind: mesh, file: ../secret.stl}",
        "lights: [{kind: environment, file: ../secret.exr}]",
    ],
)
def test_meshes_and_environments_outside_are_not_opened(tmp_path: Path, section: str) -> None:
    path = tmp_path / "scene" / "scene.yaml"
    path.parent.mkdir()
    path.write_text(f"{SMALL_SCENE}\n{section}\n", encoding="utf-8")
    with pytest.raises(InputError, match="is outside of the scene's folder"):
        plan(load_scene(path), pushes=[0])
