from pathlib import Path

import pytest

from results.pictures.lighting_sheet import LOOKS, dressed
from vbaa_bench.assembly.plan import plan
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.schema import Scene

SCENES = sorted((Path(__file__).parents[2] / "scenes" / "lighting").glob("*.yaml"))


@pytest.mark.parametrize("look", LOOKS)
def test_every_look_is_a_scene_that_could_have_been_written(look: str) -> None:
    file = load_scene(SCENES[0])
    scene = dressed(file.scene, LOOKS[look])
    assert Scene.model_validate(scene.model_dump()) == scene
    assert plan(SceneFile(file.path, scene, {})).frames == 1


def test_the_same_pushes_lie_under_every_light() -> None:
    scenes = [load_scene(path).scene for path in SCENES]
    assert len({scene.light.model_dump_json() + str(scene.lights) for scene in scenes}) == 8
    fixed = {"title", "light", "lights"}
    assert len({scene.model_dump_json(exclude=fixed) for scene in scenes}) == 1
