"""The public names of `vbaa_bench`: what they return, and that their examples run."""

import ast
import doctest
import importlib
import shutil
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import vbaa_bench as vb
from solver.instrument.images import read_grey
from tests.draws import scene_seed
from vbaa_bench.api import comparison, export, limits, preview, verification, views
from vbaa_bench.api import frame as frame_module
from vbaa_bench.api import results as results_module
from vbaa_bench.api import scene as scene_module
from vbaa_bench.assembly.plan import check_possible
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.limits import dataset_limits, maps
from vbaa_bench.scene import shipped
from vbaa_bench.scene.rendering import Layer
from vbaa_bench.scoring.isolation.runs import Job, MethodRun
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.workers import machine
from vbaa_bench.workers.jobs import SameProcess


@pytest.mark.thorough
@pytest.mark.parametrize(
    "module", [vb, frame_module, scene_module, shipped, preview], ids=lambda m: m.__name__
)
def test_examples_run(
    module: types.ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # The start of a worker takes longer than what the examples render.
    monkeypatch.setattr(machine, "Pool", SameProcess)
    monkeypatch.setattr(preview, "Pool", SameProcess)
    failed, attempted = doctest.testmod(module)
    assert failed == 0
    assert attempted > 1


@pytest.fixture(scope="module")
def scored(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> vb.Dataset:
    """The dataset of the tests, scored with one method of the paper."""
    data = vb.Dataset(shutil.copytree(dataset, tmp_path_factory.mktemp("api") / "set"))
    vb.score(data, methods="two_point")
    return data


@pytest.mark.thorough
def test_examples_with_a_scored_dataset_run(
    scored: vb.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for module in (maps, dataset_limits):
        monkeypatch.setattr(module, "Pool", SameProcess)
    for used in (verification, export, views, results_module, comparison, limits):
        failed, attempted = doctest.testmod(used, globs={"vb": vb, "data": scored})
        assert (failed, attempted > 0) == (0, True), used


def test_what_commands_do_has_an_example_in_python() -> None:
    for name in ("compare", "export", "map_limits", "preview", "render_frame", "save_baseline"):
        assert ">>> " in str(getattr(vb, name).__doc__), name
    for name in ("store_limits", "subset", "table", "verify", "view", "write_croissant"):
        assert ">>> " in str(getattr(vb, name).__doc__), name
    assert ">>> " in str(vb.write_report.__doc__)


def test_public_names_are_those_that_are_resolved_and_checked() -> None:
    source = Path(vb.__file__).read_text(encoding="utf-8")
    typed = {
        f"{alias.name}": node.module
        for branch in ast.parse(source).body
        if isinstance(branch, ast.If)
        for node in branch.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == vb._MODULES
    assert sorted(vb._MODULES) == vb.__all__
    assert set(vb.__all__) <= set(dir(vb))
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = vb.nothing  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", vb.__all__)
def test_no_module_takes_the_place_of_a_public_name(name: str) -> None:
    value = getattr(vb, name)
    for path in Path(vb.__file__).parent.glob("*"):
        assert path.stem != name
    assert value is getattr(importlib.import_module(vb._MODULES[name]), name)


@pytest.mark.thorough
def test_a_frame_is_that_of_the_dataset(dataset: Path, small_scene: Path) -> None:
    frame = vb.render_frame(str(small_scene), 2)
    row = vb.Dataset(str(dataset)).truth.frames.row(named=True, index=_place(dataset, 2))
    assert frame.truth == {name: row[name] for name in frame.truth}
    layout = Layout(dataset)
    image = next(layout.observations.glob(f"shard_*/{row['frame_id']}.png"))
    assert np.array_equal(frame.image, read_grey(image))
    layers = vb.read_exr(str(next(layout.truth.glob(f"shard_*/{row['frame_id']}.exr"))))
    assert layers.keys() == frame.layers.keys()
    assert np.array_equal(layers["object_index"], frame.layers["object_index"])
    assert frame._repr_png_().startswith(b"\x89PNG")
    assert f"{row['x_c_mm']:.4g} mm" in repr(frame)


def _place(dataset: Path, trial: int) -> int:
    frames = vb.open_truth(str(dataset / "truth")).frames
    return frames["trial"].to_list().index(trial)


def test_a_frame_that_does_not_exist_is_refused(small_scene: Path) -> None:
    with pytest.raises(vb.InputError, match="frame 4 does not exist, allowed is 0 to 3"):
        vb.render_frame(small_scene, 4)


def test_a_scene_in_python_is_checked_as_a_file_is() -> None:
    pushes = {"contact_distance_mm": [100], "deflection_pct": [10]}
    with pytest.raises(vb.InputError) as refused:
        vb.Scene(title="x", seed="one", pushes={**pushes, "repeats": 0})
    assert str(refused.value).splitlines() == [
        "Scene: seed is 'one', allowed is a whole number",
        "Scene: pushes.repeats is 0, allowed is greater than or equal to 1",
    ]


def test_a_scene_in_python_is_that_of_the_file(small_scene: Path) -> None:
    scene = vb.Scene(
        title="Four pushes for the tests",
        seed=scene_seed(11),
        camera={
            "width_px": 512,
            "height_px": 176,
            "position_mm": np.array([120.0, 22.0, 360.0]).tolist(),
            "look_at_mm": (120.6, 22.0, 0.0),
        },
        calibration={
            "columns": 20,
            "rows": 5,
            "square_mm": 10,
            "center_mm": [120.0, 22.0],
            "views": 6,
        },
        sensor={"rest_images": 2},
        pushes={"contact_distance_mm": [100, 200], "deflection_pct": [10, 20]},
        frames_per_shard=2,
        layers=get_args(Layer),
    )
    assert scene.scene == vb.load_scene(small_scene).scene
    assert vb.load_scene(str(small_scene), seed=12).scene.seed == 12


def test_a_scene_in_python_may_draw_values_for_every_push() -> None:
    scene = vb.Scene(
        title="Two pushes",
        seed=1,
        pushes={"contact_distance_mm": [120, 150], "deflection_pct": [5]},
        background={"reflectance": {"uniform": [0.05, 0.1], "per": "push"}},
    )
    assert scene.is_random
    check_possible(scene, lambda _done, _total: None, pytest.fail)


@pytest.mark.parametrize("distances", [[120.0, 150.0], [{"uniform": [120, 150], "per": "push"}]])
def test_the_check_of_pushes_shows_how_many_there_are(distances: object) -> None:
    pushes = {"contact_distance_mm": distances, "deflection_pct": [5], "draws": 2}
    shown: list[tuple[int, int]] = []
    scene = vb.Scene(title="Pushes", seed=1, pushes=pushes)
    check_possible(scene, lambda done, total: shown.append((done, total)), pytest.fail)
    assert shown == [(done, shown[0][1]) for done in range(1, shown[0][1] + 1)]


def test_named_methods_are_run_and_scored_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []
    scored: list[set[str]] = []

    def solve_each(jobs: list[Job], *_: Any) -> Iterator[MethodRun]:
        for job in jobs:
            ran.append(job.method)
            yield MethodRun(job.out, 1, 0, "")

    def write_scores(_results: Results, tables: dict[str, Path]) -> dict[str, Any]:
        scored.append(set(tables))
        return {}

    monkeypatch.setattr(results_module, "solve_each", solve_each)
    monkeypatch.setattr(results_module, "write_scores", write_scores)
    (tmp_path / "predictions").mkdir()
    for name in ("two_point", "exact_fit", "mine"):
        (tmp_path / "predictions" / f"{name}.csv").touch()
    vb.score(tmp_path, "exact_fit")
    assert ran == ["exact_fit"]
    own = [tmp_path / "other.csv"]
    vb.score(str(tmp_path), ["exact_fit", "two_point"], predictions=own)
    vb.score(tmp_path)
    assert scored == [
        {"exact_fit"},
        {"exact_fit", "two_point", "other"},
        {"exact_fit", "two_point", "mine"},
    ]
