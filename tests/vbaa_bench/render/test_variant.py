"""The probe of a variant: repeated if it was killed, believed if it ended by itself."""

import subprocess

import pytest

from vbaa_bench.render import variant

RENDERED = 'probe {"mitsuba": "3", "finite": true}\n'


@pytest.mark.parametrize(
    ("statuses", "works", "runs"), [([-9, 0], True, 2), ([-9, -9], False, 2), ([-6, 0], False, 1)]
)
def test_a_killed_probe_is_repeated_once(
    statuses: list[int], works: bool, runs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[int] = []

    def run(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        ended.append(statuses[len(ended)])
        printed = "" if ended[-1] else RENDERED
        return subprocess.CompletedProcess(command, ended[-1], printed, "")

    monkeypatch.setattr(subprocess, "run", run)
    assert variant.probe("llvm_ad_mono").works == works
    assert len(ended) == runs
