"""A first start compiles the fits in a second process; a later one starts none."""

import subprocess
from pathlib import Path

import pytest

from solver import first_start
from solver.instrument.estimate import Estimate
from solver.instrument.observation import open_observations
from solver.instrument.rig import Rig
from solver.methods.exact_fit import exact_fit


@pytest.fixture
def rig(dataset: Path) -> Rig:
    return open_observations(dataset / "observations").rig


def test_the_synthetic_measurements_are_fitted_plainly_and_robustly(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimates: list[Estimate] = []
    monkeypatch.setattr(first_start, "exact_fit", lambda m: estimates.append(exact_fit(m)))
    first_start.compile_fits(rig)
    # A linear shape is no exact one, but nearly: it was bent by a touch in the middle.
    for estimate in estimates:
        assert estimate.values["x_c_m"] == pytest.approx(rig.beam.length / 2, rel=0.02)
    assert len(estimates) == 2


def record_processes(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """Return the list to which every process is added that is begun from now on."""
    processes: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def recorded(*args: object, **options: object) -> object:
        processes.append(popen(*args, **options))  # type: ignore[call-overload]
        return processes[-1]

    monkeypatch.setattr(subprocess, "Popen", recorded)
    return processes


@pytest.mark.parametrize("compiled", [{"starts.consensus"}, None])
def test_where_the_fits_are_compiled_or_elsewhere_no_process_is_begun(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, compiled: set[str] | None
) -> None:
    begun = record_processes(monkeypatch)
    monkeypatch.setattr(first_start, "compiled_functions", lambda: compiled)
    with first_start.compile_in_background(rig):
        assert begun == []


def test_a_first_start_waits_for_its_process(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = record_processes(monkeypatch)
    monkeypatch.setattr(first_start, "compiled_functions", set)
    with first_start.compile_in_background(rig):
        assert begun[0].returncode is None
    assert begun[0].returncode == 0  # it has found the modules and fitted


def test_a_process_that_fails_costs_only_time(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = record_processes(monkeypatch)
    monkeypatch.setattr(first_start, "compiled_functions", set)
    monkeypatch.setattr(first_start, "_CHILD", "raise SystemExit(3)")
    with first_start.compile_in_background(rig):
        pass
    assert [process.returncode for process in ended] == [3]


def test_an_error_of_the_block_ends_the_process(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_start, "compiled_functions", set)
    monkeypatch.setattr(first_start, "_CHILD", "import time; time.sleep(600)")
    with pytest.raises(KeyboardInterrupt), first_start.compile_in_background(rig):
        raise KeyboardInterrupt
