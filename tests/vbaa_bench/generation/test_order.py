"""A frame does not depend on what its process has rendered before."""

from pathlib import Path

import numpy as np
import pytest

from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.scene.load import load_scene

EXPOSURE = 2e4


@pytest.mark.thorough
def test_a_frame_after_a_rest_image_is_the_same(small_scene: Path, variant: str) -> None:
    file = load_scene(small_scene)
    planned = plan(file)
    spec = planned.frame_specs[0]

    def renderer() -> FrameRenderer:
        return FrameRenderer(file.scene, planned.rig, small_scene.parent, variant, 1)

    _, alone = renderer().expose_frame(spec, Metering(EXPOSURE))
    after = renderer()
    after.rest_image(0, EXPOSURE)
    _, second = after.expose_frame(spec, Metering(EXPOSURE))
    # The touched object is in the frame only; the rest image must not decide what is around it.
    assert not alone.affected.all()
    for one, other in zip(alone.by_name().values(), second.by_name().values(), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(alone.samples, second.samples)
