"""Baseline files: what they keep, why they are replaced, and what they refuse."""

import json
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import LONGEST_SHOWN, InputError
from tests.vbaa_bench.regression.runs import METHODS, Drawn, changed
from vbaa_bench.regression.baseline import read_baseline, versions, write_baseline
from vbaa_bench.regression.cells import PairedScene
from vbaa_bench.regression.comparison import table
from vbaa_bench.regression.scored_run import pair

# Deeper than any document, and less deep than Python allows.
NESTED = json.loads('{"kind": ' * 300 + "0" + "}" * 300)


def test_a_baseline_is_small_and_equals_its_run(tmp_path: Path) -> None:
    run, path = Drawn(0).run(), tmp_path / "new" / "drawn.json"
    write_baseline(run, path)
    # 270 frames of two methods; fig8_rigid has five.
    assert path.stat().st_size < 200_000 * len(METHODS) / 5
    kept = read_baseline(path).run
    assert (kept.title, kept.scene, kept.images) == (run.title, run.scene, run.images)
    assert kept.methods == run.methods
    paired = pair(kept, run, path)
    assert paired.height == run.frames.height
    assert paired["push_id"].n_unique() == run.frames["push_id"].n_unique()
    comparison = table({"drawn": PairedScene("drawn", paired, True, True, False)})
    assert {change.verdict for change in comparison.changes} == {"same"}
    assert max(abs(c.new / c.old - 1) for c in comparison.changes) < 1e-3


def test_a_baseline_is_replaced_only_with_a_reason_and_remembers_it(tmp_path: Path) -> None:
    run, path = Drawn(0).run(), tmp_path / "drawn.json"
    write_baseline(run, path)
    better = changed(run, "force_error_pct", 0.5, pl.col("method") == "first")
    for why in (None, " "):
        with pytest.raises(InputError, match="state with --why"):
            write_baseline(better, path, why)
    write_baseline(better, path, "a better start of the fit")
    write_baseline(replace(run, frames=run.frames.filter(method="first")), path, "one is gone")
    first, second, third = versions(read_baseline(path))
    assert first.why == "first baseline"
    assert all(value.old is None for value in first.revised)
    assert {value.method for value in first.revised} == set(METHODS)
    assert second.why == "a better start of the fit"
    (value,) = second.revised
    assert (value.method, value.quantity, value.unit) == ("first", "force error", "%")
    assert value.old is not None
    assert value.new == pytest.approx(value.old / 2, rel=0.01)
    assert all(value.new is None for value in third.revised if value.method == "second")


def test_another_scene_is_refused_by_its_key(tmp_path: Path) -> None:
    run, path = Drawn(0).run(), tmp_path / "drawn.json"
    write_baseline(run, path)
    other = replace(run, title="Other", scene={**run.scene, "light": {"side_mm": 5}})
    with pytest.raises(InputError, match=r"'Drawn' and 'Other'; light differs"):
        write_baseline(other, path, "by mistake")
    with pytest.raises(InputError, match="is of another scene than the run") as refusal:
        write_baseline(replace(other, title="x" * 9000, scene={"y" * 9000: 1}), path, "by mistake")
    assert len(str(refusal.value)) < len(str(path)) + 4 * LONGEST_SHOWN


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 2}, "format is 2, allowed is 1"),
        ({"methods": {"first": {"outcome": ["contact"]}}}, "is not a baseline"),
        ({"format": "x" * 9000}, "format is 'xxx"),
        ({"methods": {"first": {"outcome": ["x" * 9000], "s_c_error_pct_L": ["x" * 9000]}}}, "not"),
        ({"methods": {}}, "methods is {}, which is not allowed"),
        ({"frames": None}, "frames is None, which is not allowed"),
        ({"frames": {"rig": NESTED}}, r"frames\.rig is {'kind': {'kind': "),
        ({"history": None}, "history is None, which is not allowed"),
        ({"history": [{"typical": {}}]}, r"the key history\.0\.why is missing"),
        ({"history": [{"why": "", "typical": {"a": {"b": 1e300}}}]}, r"typical\.a\.b is 1e\+300"),
    ],
)
def test_a_file_that_is_no_baseline_is_refused(
    tmp_path: Path, change: dict[str, object], message: str
) -> None:
    path = tmp_path / "drawn.json"
    write_baseline(Drawn(0, 1).run(), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=message) as refusal:
        read_baseline(path)
    assert len(str(refusal.value)) < len(str(path)) + 3 * LONGEST_SHOWN


def test_a_number_of_a_frame_that_would_overflow_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "drawn.json"
    write_baseline(Drawn(0, 1).run(), path)
    document = json.loads(path.read_text())
    document["frames"]["true_x_c_mm"][0] = 1e300
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"true_x_c_mm is not finite, or above 1e\+30"):
        read_baseline(path)


def test_a_baseline_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_baseline(Drawn(0, 1).run(), tmp_path / "file" / "drawn.json")
