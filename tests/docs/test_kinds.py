"""The page on kinds of your own: its file works, also in workers, and is not needed afterwards."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from typer.main import get_command

from solver.instrument.errors import InputError
from tests.forgotten import forgotten
from vbaa_bench.api.results import score, solve
from vbaa_bench.api.verification import verify
from vbaa_bench.cli.main import app
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.identity import OtherDatasetError
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.overall_digest import dataset_digest
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.generation.generate import generate
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.user_modules import modules_in_use, use_module

PAGE: Final = (Path(__file__).parents[2] / "docs" / "kinds.md").read_text(encoding="utf-8")
# In place of the page's own pushes: two frames of a small image, and all kinds of the page.
SMALL: Final = """
object: {kind: hex_bar, texture: {kind: bands}, paint: lacquer}
background: {pattern: dots, reflectance: 0.2}
occlusion: {kind: [cross], availability: [0.9]}
camera: {width_px: 256, height_px: 88, focal_length_px: 350, position_mm: [120, 22, 360],
         look_at_mm: [120, 22, 0]}
calibration: {columns: 20, rows: 5, square_mm: 10, center_mm: [120, 22], views: 4}
pushes: {contact_distance_mm: [120], deflection_pct: [5, 10]}
frames_per_shard: 1
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the page's module and scene, in which the commands run."""
    *lamp, bar, bands, looks = blocks("python")
    (tmp_path / "my_lamp.py").write_text("\n".join(lamp), encoding="utf-8")
    (tmp_path / "my_object.py").write_text(f"{bar}\n{bands}", encoding="utf-8")
    (tmp_path / "my_looks.py").write_text(looks, encoding="utf-8")
    (text,) = blocks("yaml")
    text = text.partition("pushes:")[0].replace("lights:", "lights:\n  - {kind: sun}")
    (tmp_path / "my_scene.yaml").write_text(text + SMALL, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with forgotten():
        yield tmp_path


def made(folder: Path, workers: int, variant: str) -> Layout:
    root = folder / f"by_{workers}"
    file = load_scene(folder / "my_scene.yaml").rig(0)
    return generate(file, root, variant, workers, lambda _done, _total: None)


@pytest.mark.thorough
def test_the_page_works_from_a_scene_to_its_scores(folder: Path, variant: str) -> None:
    scene, module = folder / "my_scene.yaml", folder / "my_lamp.py"
    use_module("my_lamp")
    use_module("my_object")
    use_module("my_looks")
    digests = {used.name: used.digest for used in modules_in_use()}
    one, two = made(folder, 1, variant), made(folder, 2, variant)
    assert dataset_digest(one.root) == dataset_digest(two.root)
    assert read_json(one.identity)["modules"] == digests
    # Comments are no code; other code is another dataset.
    module.write_text(module.read_text() + "# Hung on Monday.\n")
    use_module("my_lamp")
    made(folder, 1, variant)
    module.write_text(module.read_text().replace("elevation_deg > 0", "elevation_deg > 1"))
    use_module("my_lamp")
    with pytest.raises(OtherDatasetError, match=r"of a module of kinds \(my_lamp [0-9a-f]+ -> "):
        made(folder, 1, variant)
    with forgotten():
        with pytest.raises(InputError) as refused:
            load_scene(scene)
        assert str(refused.value) == (
            f"{scene}:4:6: lights[0].kind is 'sun', allowed is one of area, side, ring, back, "
            f"stripe, spot, environment; a kind of your own needs --module\n"
            f"{scene}:5:6: lights[1].kind is 'led_bar', allowed is one of area, side, ring, back, "
            f"stripe, spot, environment; a kind of your own needs --module\n"
            f"{scene}:8:14: background.pattern is 'dots', allowed is one of plain, squares, "
            "graded, textured, image; a kind of your own needs --module\n"
            f"{scene}:7:10: object.kind is 'hex_bar', allowed is one of block, cylinder, peg, "
            "sphere, knife_edge, wall, plunger, pad, mesh, weight, none; a kind of your own needs "
            "--module\n"
            f"{scene}:9:20: occlusion.kind[0] is 'cross', allowed is one of removed, sheet, bars, "
            "leaves; a kind of your own needs --module"
        )
        assert open_truth(one.truth).frames.height == 2
        assert verify(one.root).faults == []
        solve(one.root, ["exact_fit"])
        assert score(one.root).table()["n"].to_list() == [2]
        # Only what renders again needs the module, and says so.
        (folder / "by_1/observations/shard_00000").rename(folder / "lost")
        missing = r"identity.json: lights\[0\]\.kind is 'sun', .*\n.*\n.*\n.* object\.kind is 'hex_"
        with pytest.raises(
            InputError, match=f"{missing}.*\n.*; a kind of your own needs --module$"
        ):
            verify(one.root, repair=True)


@pytest.mark.thorough
def test_the_commands_of_the_page_use_the_module(folder: Path) -> None:
    (text,) = blocks("sh")
    lines = [line.partition("#")[0].split()[1:] for line in text.splitlines()]
    assert [line[0] for line in lines] == ["view", "run"]
    others = ["--module", "my_object", "--module", "my_looks"]
    app([*lines[0], *others], standalone_mode=False)
    assert (folder / "my_scene_0.png").is_file()
    assert [module.name for module in modules_in_use()] == ["my_lamp", "my_object", "my_looks"]


def test_every_command_that_builds_a_scene_takes_modules() -> None:
    commands = get_command(app).commands  # type: ignore[attr-defined]
    takers = {
        name
        for name, command in commands.items()
        if any("--module" in parameter.opts for parameter in command.params)
    }
    makers = {"run", "generate", "merge", "verify", "stress"}
    assert takers == makers | {"limits", "budget", "view"}
