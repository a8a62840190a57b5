"""Maps of limits: scaling laws of linear theory, places out of reach, and a frame's own limits."""

from pathlib import Path

import polars as pl
import pytest

from vbaa_bench.limits import maps as mapping
from vbaa_bench.limits.designs import designs
from vbaa_bench.limits.places import Grid, grid, places, scene_of_map
from vbaa_bench.limits.table import LimitsOfPushes
from vbaa_bench.limits.visible_places import visible_by_plan
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig
from vbaa_bench.workers.jobs import SameProcess

FIG8 = Path("scenes/fig8_rigid.yaml")
QUICKSTART = Path("scenes/quickstart.yaml")
# A flat face that is many pixels wide, so that all information is in its two sharp edges.
FLAT = ("beam.diameter_mm=1.6", "beam.section=strip", "beam.aspect_ratio=2")
TWICE = "camera.width_px+camera.height_px+camera.focal_length_px=512+512+700,1024+1024+1400"


def mapped(
    path: Path, places: Grid, variant: str, *vary: str, settings: tuple[str, ...] = ()
) -> pl.DataFrame:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mapping, "Pool", SameProcess)
        compared = designs(path, vary, "planar", None, settings)
        return mapping.maps(compared, places, "planar", variant, 1, lambda _done, _total: None)


@pytest.fixture(scope="module")
def resolutions(variant: str) -> pl.DataFrame:
    return mapped(FIG8, grid([75], [0.1, 0.2]), variant, TWICE, settings=FLAT)


@pytest.fixture(scope="module")
def partly_reached(variant: str) -> pl.DataFrame:
    return mapped(QUICKSTART, grid([1, 50], [5, 45]), variant)


def test_noise_limits_x_c_in_proportion_to_one_over_the_deflection(
    resolutions: pl.DataFrame,
) -> None:
    # In linear theory all displacements are in proportion to the deflection. At small ones noise
    # is all that matters: errors of the calibration are in proportion to displacements.
    for _, rows in resolutions.group_by("design"):
        small, large = rows.sort("deflection_pct")["x_c_limit_pct_L"]
        assert small / large == pytest.approx(2, rel=0.02)


def test_twice_the_pixels_improve_the_limit_by_the_power_of_three_halves(
    resolutions: pl.DataFrame,
) -> None:
    # A pixel of an edge informs on its position in pixels as before; in metres that is 4 times the
    # information, and there are twice as many pixels along the edge.
    for _, rows in resolutions.group_by("deflection_pct"):
        coarse, fine = rows["x_c_limit_mm"]
        assert coarse / fine == pytest.approx(2**1.5, rel=0.05)


def test_units_are_of_the_beam_and_of_the_force(resolutions: pl.DataFrame) -> None:
    row = resolutions.row(0, named=True)
    assert row["contact_distance_mm"] == pytest.approx(0.75 * 240)
    assert row["x_c_limit_pct_L"] == pytest.approx(100 * row["x_c_limit_mm"] / 240)
    assert row["force_limit_mn"] == pytest.approx(1e3 * row["force_limit_n"])
    assert row["force_limit_pct"] == pytest.approx(100 * row["force_limit_mn"] / row["force_mn"])
    # Linear theory: F = 6 EI y_tip / (x_c^2 (3 L - x_c)) of a cantilever, with L = 240 mm.
    rigidity_n_mm2 = 200e3 * 1.6**4 / 12 * 2
    force_n = 6 * rigidity_n_mm2 * 0.24 / (180**2 * (3 * 240 - 180))
    assert row["force_mn"] == pytest.approx(1e3 * force_n, rel=1e-3)


def test_a_place_out_of_reach_is_blank_and_the_others_remain(partly_reached: pl.DataFrame) -> None:
    assert partly_reached.height == 4
    reached = partly_reached.filter(pl.col("force_mn").is_not_null())
    assert reached.select("contact_distance_pct_L", "deflection_pct").rows() == [(50.0, 5.0)]
    assert reached["reason"].to_list() == [None]
    reasons = partly_reached.drop_nulls("reason").sort("contact_distance_pct_L", "deflection_pct")
    hub, also_hub, view = reasons["reason"]
    assert hub == also_hub
    assert "allowed is beyond the hub's radius" in hub
    assert "does not see the whole beam" in view
    assert reasons["x_c_limit_mm"].null_count() == 3


def test_a_place_has_the_limits_of_such_a_frame(partly_reached: pl.DataFrame, variant: str) -> None:
    activate(variant, 1)
    pushed = ["pushes.contact_distance_mm=[120]", "pushes.deflection_pct=[5, 10]"]
    drawn = load_scene(QUICKSTART, settings=[*pushed, "tolerances.true_rig=drawn"]).scene
    nominal = load_scene(QUICKSTART).scene
    # The nominal rig, whose tolerances count.
    limits = LimitsOfPushes(drawn, true_rig(nominal), QUICKSTART.parent)
    rows = limits.rows(Frames(drawn).of_push(0), visible_by_plan)
    of_frame = next(row for row in rows if row["information"] == "planar")
    of_place = partly_reached.drop_nulls("force_mn").row(0, named=True)
    for name in ("x_c_limit_mm", "s_c_limit_mm", "force_limit_n"):
        assert of_place[name] == pytest.approx(of_frame[name], rel=1e-6)


def test_the_first_push_states_direction_stiffness_and_angle() -> None:
    springs = load_scene("scenes/fig11_stiffness.yaml")
    pushes = springs.scene.pushes
    assert pushes is not None
    prepared = scene_of_map(springs, "image").scene.pushes
    assert prepared is not None
    assert prepared.stiffness_n_m == pytest.approx(pushes.stiffness_n_m[:1])
    assert len(set(prepared.motor_angle_at_contact_deg)) == 1
    hidden = scene_of_map(load_scene("scenes/fig13_occlusion.yaml"), "image")
    assert hidden.scene.occlusion is None


def test_a_push_is_solved_as_far_as_it_is_possible() -> None:
    # Pressed to 30 %, the pad would be thinner than nothing.
    file = scene_of_map(load_scene("scenes/objects/soft_pad.yaml"), "image")
    soft, hard = places(file, true_rig(file.scene), 36.0, [1, 30])
    assert soft.state is not None
    assert hard.state is None
    assert "the pad is dented" in hard.reason
