"""Information limits are attained by the most likely estimate, and by both roads."""

from dataclasses import replace
from pathlib import Path

import pytest

from results.limits import agreement, rendered, trials
from results.limits.agreement import LimitedFrame, LitScene
from solver.instrument.errors import InputError
from tests.results.test_limits_rendered import SCENE
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.load import load_scene

EXPOSURES = 2000


@pytest.fixture(scope="module")
def lit(variant: str, tmp_path_factory: pytest.TempPathFactory) -> LitScene:
    if variant == PLAIN:
        pytest.skip("a scalar variant renders whole images only")
    path: Path = tmp_path_factory.mktemp("limits") / "small.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return LitScene(load_scene(path), variant)


def test_the_most_likely_contact_of_noisy_exposures_reaches_the_limit(
    lit: LitScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trials, "_REPEATED", 3)
    record = trials.trials(LimitedFrame(lit, lit.frames(1)[0]), EXPOSURES)
    # The standard deviation of 2,000 estimates is uncertain by 1.6 %.
    assert record["spread_over_limit"] == pytest.approx(1.0, abs=0.12)
    # Two renders of the expected image differ, and the estimates' mean has an error of 0.02.
    assert abs(record["bias_over_limit"]) < 0.2
    assert record["second_step_over_limit"] < 0.2
    assert len(trials.lines([record])[0]) == len(trials.HEADS)


def test_both_roads_agree(lit: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    # With three times the render noise, limits are within 5 %, and a third of the samples suffices.
    monkeypatch.setattr(rendered, "LARGEST_NOISE", 0.1)
    record = agreement.agreement(lit, lit.frames(1)[0])
    for name, count in (("planar", 3), ("image", 4)):
        ones = [1.0] * count
        assert record[name]["closed"] == pytest.approx(ones, abs=0.2)
        assert record[name]["half_step"] == pytest.approx(ones, abs=0.1)
        assert record[name]["double_step"] == pytest.approx(ones, abs=0.1)
    # The light of the scene's lamps has no shadows.
    assert record["planar"]["lamps"] == pytest.approx([1.0] * 3, abs=0.2)
    assert 0.8 < record["shift_ratio_min"] < record["shift_ratio_max"] < 1.25
    assert all(len(row) == len(agreement.HEADS) for row in agreement.lines([record]))


def test_a_fixed_pattern_is_not_drawn_anew(lit: LitScene) -> None:
    sensor = lit.file.scene.sensor.model_copy(update={"prnu_pct": 1.0})
    scene = lit.file.scene.model_copy(update={"sensor": sensor})
    other = LitScene(replace(lit.file, scene=scene), lit.variant)
    with pytest.raises(InputError, match="fixed pattern"):
        trials.trials(LimitedFrame(other, other.frames(1)[0]), EXPOSURES)
