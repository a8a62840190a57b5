"""The table of samples: what it learns brings the noise of other frames to its target."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.draws import generator
from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer, metered_frames
from vbaa_bench.render.sample_table import Sampled, SampleTable, kinds
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.load import load_scene

SCENES = Path(__file__).parents[3] / "scenes"


def sampled(table: SampleTable, count: int, seed: int) -> Sampled:
    """Pixels whose variance is known: a tenth of what is predicted, falling more slowly."""
    random = generator(__name__, seed)
    kind = kinds(np.ones(count, np.bool_), np.ones(count, np.bool_), False)
    predicted = np.full(count, 64.0)
    size = table.corrected(kind, predicted)
    excess = 0.1 * (predicted / size) ** 1.2 * random.chisquare(1, count)
    return Sampled(kind, predicted, excess)


def test_it_learns_the_variance_whatever_its_decay() -> None:
    table = SampleTable()
    for seed in range(3):
        table = table.refined(sampled(table, 20_000, seed))
    # It ends 0.02 +- 0.01 below.
    assert sampled(table, 20_000, 9).excess.mean() == pytest.approx(1, abs=0.08)


def test_a_few_pixels_change_it_little() -> None:
    kind, few = kinds(np.ones(2, np.bool_), np.zeros(2, np.bool_), True), np.array([8.0, 8.0])
    table = SampleTable().refined(Sampled(kind, few, np.array([0.0, 30.0])))
    # By chance the mean of two is 15 times the target; that of a prior of 100 pixels is 1.
    half_a_step = 2**0.125 - 1  # factors are powers of 2^(1/4)
    assert table.factors.max() == pytest.approx((130 / 102) ** (1 / 0.85), rel=half_a_step)
    assert (table.factors != 1).sum() == 1


def test_kinds_are_told_apart() -> None:
    dense, covered = np.array([False, True, True]), np.array([False, False, True])
    assert kinds(dense, covered, False).tolist() == [0, 1, 2]
    assert kinds(dense, covered, True).tolist() == [3, 4, 4]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["quickstart.yaml", "fig14_micro.yaml"])
def test_other_frames_have_the_target_noise(name: str, variant: str) -> None:
    """By distance from the beam; shadows may have less: their pixels have the fewest samples."""
    if variant == PLAIN:
        pytest.skip("without wavefronts every pixel gets the same samples")
    file = load_scene(SCENES / name)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, file.path.parent, variant, threads=2)
    specs = sorted(work.frame_specs, key=lambda spec: spec.index)
    metering = renderer.meter(metered_frames(specs))
    noise = renderer.sensor(metering.exposure).noise_sigma
    near_px, spec = file.scene.render.near_beam_px, file.scene.render
    sums = dict[float, list[float]]()
    for frame in specs[len(specs) // 4 :: max(len(specs) // 3, 1)]:
        _, rendered = renderer.expose_frame(frame, metering)
        without = (rendered.coverage == 0).astype(np.uint8)
        distance = cv2.distanceTransform(without, cv2.DIST_L2, 5)
        ratio2 = rendered.variance / noise(rendered.radiance) ** 2
        for low, high in ((-1.0, 0.5), (0.5, 2.0), (2.0, near_px - 1.0), (near_px + 2.0, 16.0)):
            where = rendered.affected & (distance > low) & (distance <= high)
            sums.setdefault(low, []).extend(ratio2[where])
    for low, values in sums.items():
        target = spec.noise_near_beam if low < near_px else spec.noise_elsewhere
        ratio = np.sqrt(np.mean(values)) / target
        assert (0.7 if low < 0 else 0) < ratio < 1.25, (low, len(values))
