from pathlib import Path

import pytest

from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.scene.frames import frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig

FIG8 = Path(__file__).parents[3] / "scenes" / "fig8_rigid.yaml"


@pytest.mark.parametrize("mechanics", ["exact", "linear"])
@pytest.mark.parametrize("target", ["deflection_pct", "pushing_angle_deg"])
def test_a_target_that_underflows_to_zero_gives_the_free_beam(target: str, mechanics: str) -> None:
    """5e-324 is the least number above zero; in radians or of L it is zero."""
    pushes = f"pushes={{contact_distance_mm: [100], {target}: [5.0e-324]}}"
    file = load_scene(FIG8, settings=[pushes, f"mechanics={mechanics}"])
    push = frame_specs(file.scene)[0].push
    (state,) = Experiment(file.scene, true_rig(file.scene), push, FIG8.parent).states()
    assert state.contacts == ()
    assert state.tip == pytest.approx([0.24, 0, 0], abs=1e-15)
