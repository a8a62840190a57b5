"""Images do not depend on the processor: each pixel has random numbers of its own.

Vectors of another width round differently, as on another processor. A pixel may then differ by its
last digits, but does not change the others. `results/same_bytes` measures it on all scenes.
"""

import ctypes
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import drjit
import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.consistency import MOST_SIGMAS
from tests.draws import generator, scene_seed
from vbaa_bench.assembly.plan import plan
from vbaa_bench.dataset.target import FAST, NATIVE, target
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.render.frame import RenderedRadiance
from vbaa_bench.render.tracing import Quantity, trace
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.load import load_scene
from vbaa_bench.sensor.sensor import Sensor

WIDTH = "VBAA_BENCH_VECTOR_WIDTH"


class Case(NamedTuple):
    renderer: FrameRenderer
    spec: FrameSpec


def case(scene: Path) -> Case:
    file = load_scene(scene)
    work = plan(file)
    return Case(FrameRenderer(file.scene, work.rig, scene.parent, FAST, 1), work.frame_specs[0])


@pytest.fixture
def width(variant: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Set the vectors' width for a test, by its environment."""
    if variant != FAST:
        pytest.skip("needs kernels that are compiled here")
    yield monkeypatch
    monkeypatch.undo()
    activate(FAST, 1)


@pytest.mark.thorough
@pytest.mark.parametrize("quantity", ["whole", "still", "change"])
def test_a_pixel_does_not_depend_on_the_others(
    quantity: Quantity, small_scene: Path, variant: str, random: np.random.Generator
) -> None:
    if variant != FAST:
        pytest.skip("whole images are rendered")
    renderer, spec = case(small_scene)
    world = renderer.pushed_world(renderer.pose(spec))
    rows, columns = np.mgrid[60:100, 120:180].reshape(2, -1)
    pixels, size = np.column_stack([columns, rows]), random.integers(4, 32, len(rows))
    everywhere = trace(world, pixels, size, scene_seed(7), quantity)
    some = random.permutation(len(rows))[: len(rows) // 3]
    alone = trace(world, pixels[some], size[some], scene_seed(7), quantity)
    assert everywhere.radiance.any()
    assert (alone.radiance == everywhere.radiance[some]).all()
    assert (alone.variance == everywhere.variance[some]).all()
    assert (
        trace(world, pixels, size, scene_seed(8), quantity).radiance != everywhere.radiance
    ).any()


def test_neighbours_and_seeds_have_independent_numbers(small_scene: Path, variant: str) -> None:
    if variant != FAST:
        pytest.skip("whole images are rendered")
    renderer, spec = case(small_scene)
    world = renderer.pushed_world(renderer.pose(spec))
    rows, columns = np.mgrid[100:116, 20:84].reshape(2, -1)
    pixels, size = np.column_stack([columns, rows]), np.full(len(rows), 4)
    images = [trace(world, pixels, size, scene_seed(seed), "still").radiance for seed in range(64)]
    z = np.reshape(images, (64, 16, 64))
    z = (z - z.mean(axis=0)) / z.std(axis=0)
    # Under independence, the mean of n products has the standard deviation n^-1/2. Of seeds, whose
    # mean was subtracted, it is -1 / 63.
    pairs = ((z[:, 1:], z[:, :-1], 0), (z[:, :, 1:], z[:, :, :-1], 0), (z[1:], z[:-1], -1 / 63))
    for one, other, expected in pairs:
        assert abs((one * other).mean() - expected) * np.sqrt(one.size) < MOST_SIGMAS


@pytest.mark.thorough
def test_the_width_of_vectors_changes_few_pixels(
    small_scene: Path, width: pytest.MonkeyPatch
) -> None:
    images, radiances, widths = list[dict[int, Floats]](), list[RenderedRadiance](), list[int]()
    exposure = case(small_scene).renderer.measure_exposure()
    for values in (8, 4):
        width.setenv(WIDTH, str(values))
        renderer, spec = case(small_scene)
        _, rendered = renderer.expose_frame(spec, Metering(exposure))
        sensor = renderer.sensor(exposure)
        assert isinstance(sensor, Sensor)
        images.append({bits: exposed(sensor, bits, rendered) for bits in (8, 16)})
        radiances.append(rendered)
        widths.append(compiled_width())
    assert widths == [8, 4]
    # None of a million in 90 scenes (results/same_bytes); by chance, 90 of 90,000 never.
    assert np.mean(images[0][8] != images[1][8]) < 1e-3
    noise = sensor.noise_sigma(radiances[0].radiance) / float(sensor.largest_radiance) * 65_535
    # A ray that meets another surface at another width changes its pixel alone.
    squares = np.sort((images[0][16] - images[1][16]).ravel() ** 2)[: -noise.size // 10_000]
    assert np.sqrt(np.mean(squares)) < 0.01 * np.sqrt(np.mean(noise**2))


def compiled_width() -> int:
    """Number of values in the vectors of Dr.Jit's kernels, which it states in C++ only."""
    suffix = "dylib" if sys.platform == "darwin" else "so"
    core = ctypes.CDLL(str(Path(drjit.__file__).parent / f"libdrjit-core.{suffix}"))
    return int(core._Z21jit_llvm_vector_widthv())


def exposed(sensor: Sensor, bits: int, rendered: RenderedRadiance) -> Floats:
    """Expose with another number of bits and the noise of one seed."""
    noise = generator(__name__, 1)  # the same for both widths
    gray = replace(sensor, bits=bits, gain=None).expose(rendered.radiance, noise, rendered.variance)
    return gray.astype(float)


def test_the_target_is_named_and_the_same_on_all_machines_of_an_architecture(
    width: pytest.MonkeyPatch,
) -> None:
    width.delenv(WIDTH, raising=False)
    width.setattr("platform.machine", lambda: "x86_64")
    assert target(FAST) == "x86-64-v3, vectors of 8"
    assert target(NATIVE) != target(FAST)
    width.setenv(WIDTH, "4")
    assert target(FAST) == "x86-64-v3, vectors of 4"
