"""Modules with kinds of users: used by name alone, stated where a scene may have their kinds."""

import importlib
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from solver.instrument.errors import InputError
from tests.forgotten import forgotten
from tests.vbaa_bench.residents import KindsOfLight
from vbaa_bench.render.illumination import lights
from vbaa_bench.scene.load import SceneFile, check_scene
from vbaa_bench.scene.user_modules import modules_in_use, use_module
from vbaa_bench.workers.pool import Pool

GLOW = '''
from typing import Literal
from pydantic import Field
from vbaa_bench.kinds import LIGHTS, AimedKind, ImageName, Triple

class Glow(AimedKind):
    """A glow."""

    kind: Literal["glow"]
    position_mm: Triple = Field(default=(0.0, 0.0, 500.0), description="Its place.")
    slide: ImageName | None = Field(default=None, description="Its slide.")

    def emitter(self, setting, files):
        raise NotImplementedError

LIGHTS.register(Glow)
'''
PUSHES = {"contact_distance_mm": [120], "deflection_pct": [5]}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "glowing.py").write_text(GLOW, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with forgotten():
        yield tmp_path


def scene_under(*stated: dict[str, Any]) -> SceneFile:
    return check_scene({"title": "x", "seed": 1, "pushes": PUSHES, "lights": list(stated)})


def test_only_a_module_that_is_named_adds_its_kinds(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(folder))
    imported = importlib.import_module("glowing")
    refusal = (
        r"^Scene: lights\[0\]\.kind is 'glow', allowed is one of area, .*, environment; a kind of "
        "your own needs --module$"
    )
    with pytest.raises(InputError, match=refusal):
        scene_under({"kind": "glow"})
    use_module("glowing")
    light = scene_under({"kind": "glow"}).scene.lights[0]
    assert type(light).__module__ == "glowing"
    assert not isinstance(light, imported.Glow)  # it is the file that was read, and is stated
    with pytest.raises(InputError, match=r"\.slid is an unknown key; did you mean slide"):
        scene_under({"kind": "glow", "slid": "a.png"})


@pytest.mark.parametrize("height", [500, {"uniform": [400, 500]}])
def test_an_unknown_kind_is_one_mistake_whatever_else_is_random(height: Any) -> None:
    lamp = {"kind": "glow", "position_mm": [0, 0, height]}
    with pytest.raises(InputError, match=r"^Scene: lights\[0\]\.kind is 'glow', .* --module$"):
        scene_under(lamp)


def test_a_light_that_builds_no_emitter_is_named(folder: Path) -> None:
    text = GLOW.replace("raise NotImplementedError", "return [1, 2]")
    (folder / "glowing.py").write_text(text, encoding="utf-8")
    use_module("glowing")
    file = scene_under({"kind": "glow"})
    with pytest.raises(InputError, match=r"kind glow has returned list, allowed is one Emitter; "):
        lights(file.scene, folder)


def test_a_scene_states_the_modules_of_kinds_that_it_may_draw() -> None:
    use_module("glowing")
    ((name, digest),) = [(module.name, module.digest) for module in modules_in_use()]
    drawn = {"choice": [{"kind": "spot"}, {"kind": "glow", "slide": "a.png"}]}
    assert scene_under({"kind": "spot"}).user_modules == {}
    assert scene_under({"kind": "glow"}).user_modules == {name: digest}
    assert scene_under(drawn).user_modules == {name: digest}
    assert [named[1:] for named in scene_under(drawn).named_files] == [("a.png", "image")]


def test_layout_and_comments_of_a_module_are_no_code(folder: Path) -> None:
    use_module("glowing")
    before = scene_under({"kind": "glow"}).user_modules
    (folder / "glowing.py").write_text(f"# A lamp.\n{GLOW}", encoding="utf-8")
    use_module("glowing")
    assert scene_under({"kind": "glow"}).user_modules == before
    (folder / "glowing.py").write_text(GLOW.replace("500.0", "501.0"), encoding="utf-8")
    use_module("glowing")
    assert scene_under({"kind": "glow"}).user_modules != before
    assert scene_under({"kind": "glow"}).scene.lights[0].model_dump()["position_mm"][2] == 501


@pytest.mark.parametrize(
    ("name", "source", "said"),
    [
        ("absent", None, "module 'absent' is unknown, allowed is the name of a file here or on"),
        ("../glowing", None, r"module '\.\./glowing' is unknown, allowed is the name"),
        ("broken", "import nothing_of_that_name", r"broken\.py: cannot be imported \(ModuleNot"),
        ("broken", "def", r"broken\.py: cannot be imported \(SyntaxError: "),
        ("pytest", "", "module pytest: has the name of another module"),
        (
            "broken",
            GLOW.replace('"glow"', '"spot"'),
            r"broken\.Glow: kind spot is that of vbaa_bench\.scene\.lights\.spot\.SpotSpec",
        ),
        ("broken", GLOW.replace('["glow"]', '["a", "b"]'), r"broken\.Glow: has no key kind"),
    ],
)
def test_a_module_that_cannot_be_used_is_refused(
    folder: Path, name: str, source: str | None, said: str
) -> None:
    if source is not None:
        (folder / f"{name}.py").write_text(source, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        use_module(name)
    assert modules_in_use() == ()
    assert name == "pytest" or name not in sys.modules


def test_worker_processes_get_the_module_with_their_first_job(folder: Path) -> None:
    use_module("glowing")
    scene = scene_under({"kind": "glow"}).scene
    (folder / "glowing.py").unlink()
    with Pool(1, KindsOfLight, (scene,)) as pool:
        assert pool.call("kinds", "") == ["glow"]
    data = pickle.dumps((modules_in_use(), scene))
    with forgotten():
        _, unpickled = pickle.loads(data)
        assert unpickled.lights[0].kind == "glow"
        assert [module.name for module in modules_in_use()] == ["glowing"]
