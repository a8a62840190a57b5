"""Scenes of the package, by name."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from vbaa_bench import cli
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.shipped import find_scene, list_scenes, shipped_scene_files, shipped_scenes

SCENES = Path(__file__).parents[3] / "scenes"


def test_a_name_is_a_file_of_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert shipped_scenes().samefile(SCENES)
    scene = load_scene("objects/mesh")
    assert scene.path.samefile(SCENES / "objects/mesh.yaml")
    # The files that it names are beside it.
    assert [(scene.folder / file.name).is_file() for file in scene.named_files] == [True]


def test_a_file_wins_over_a_name_and_a_folder_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # Such as in the folder of datasets.
    Path("quickstart").mkdir()
    assert find_scene("quickstart").samefile(SCENES / "quickstart.yaml")
    Path("hard").mkdir()
    Path("hard/taper").write_text("title: My own\n", encoding="utf-8")
    assert find_scene("hard/taper") == Path("hard/taper")


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("quikstart", "did you mean quickstart?"),
        ("taper", "did you mean hard/taper?"),
        ("scenes/hard/tapper.yaml", "did you mean hard/taper?"),
        ("nothing_like_it", "`vbaa-bench scenes` lists them"),
        ("../quickstart", "did you mean quickstart?"),
    ],
)
def test_what_is_neither_a_file_nor_a_name_gets_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, hint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        load_scene(name)
    assert str(caught.value) == f"{name}: is neither a file nor a shipped scene; {hint}"


def test_every_scene_says_in_one_sentence_what_it_shows() -> None:
    scenes = list_scenes()
    assert {scene.path for scene in scenes} == set(shipped_scene_files())
    assert all(scene.shows.endswith(".") and scene.shows[:-1] for scene in scenes)
    assert len({scene.shows for scene in scenes}) == len(scenes)


def test_the_command_lists_a_line_for_every_scene() -> None:
    scenes = list_scenes()
    lines = CliRunner().invoke(cli.app, ["scenes"]).stdout.splitlines()
    assert [line.split("  ")[0] for line in lines if line] == [scene.name for scene in scenes]
    record = json.loads(CliRunner().invoke(cli.app, ["scenes", "--json"]).stdout)
    assert record["scenes"][0] == {
        "name": scenes[0].name,
        "shows": scenes[0].shows,
        "file": str(scenes[0].path),
    }


@pytest.mark.parametrize("command", ["run", "generate", "stress", "view", "limits"])
def test_every_command_with_a_scene_takes_names(command: str) -> None:
    done = CliRunner().invoke(cli.app, [command, "taper"])
    assert str(done.exception).endswith("did you mean hard/taper?")


def test_a_command_says_which_file_a_name_is() -> None:
    done = CliRunner().invoke(cli.app, ["view", "hard/taper", "--set", "beam.lenght_mm=1"])
    assert done.stderr.splitlines()[0] == f"scene: {shipped_scenes() / 'hard/taper.yaml'}"
    said = "hard/taper.yaml with beam.lenght_mm=1: beam.lenght_mm is an unknown key"
    assert said in str(done.exception)
