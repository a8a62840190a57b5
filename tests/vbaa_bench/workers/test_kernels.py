"""Processes that make data use the same kernels on every processor."""

import os
import subprocess
import sys
from collections import deque
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from threadpoolctl import threadpool_info

from vbaa_bench.workers.jobs import Job
from vbaa_bench.workers.kernels import reference_kernels
from vbaa_bench.workers.pool import Pool

NAMES = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")
HAS_AVX2, HAS_AVX_512 = (cv2.checkHardwareSupport(number) for number in (11, 13))


class Kernels:
    """Names the kernels of the process that it is in."""

    def named(self, _on_progress: Any) -> list[str]:
        """Names of the kernels of linear algebra."""
        np.linalg.inv(np.eye(2))
        return [
            str(one["architecture"]) for one in threadpool_info() if "openblas" in one["prefix"]
        ]


@pytest.mark.skipif(not HAS_AVX2, reason="such a processor keeps its own kernels")
def test_workers_use_the_reference_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    with Pool(1, Kernels, ()) as pool:
        (ended,) = pool.outcomes(deque([Job("named", ())]), lambda _pieces: None)
    assert ended.result
    assert set(ended.result) == {"Haswell"}


def test_a_choice_of_the_user_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.setenv(name, "mine")
    with reference_kernels():
        assert [os.environ[name] for name in NAMES] == ["mine", "mine"]
    assert [os.environ[name] for name in NAMES] == ["mine", "mine"]


def test_the_environment_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    with reference_kernels():
        assert ("OPENBLAS_CORETYPE" in os.environ) == HAS_AVX2
        assert ("NPY_DISABLE_CPU_FEATURES" in os.environ) == HAS_AVX_512
    assert not any(name in os.environ for name in NAMES)


@pytest.mark.thorough
@pytest.mark.skipif(not HAS_AVX2, reason="such a processor keeps its own kernels")
def test_a_dataset_does_not_depend_on_the_kernels_of_its_command(tmp_path: Path) -> None:
    """Readings of the moment sensor follow from mechanics to the last digit."""
    script = (
        "import os, sys, numpy\n"
        f"for name in {NAMES}: os.environ.pop(name, None)\n"
        "from vbaa_bench.cli import main\n"
        "if __name__ == '__main__': main()\n"
    )
    (tmp_path / "command.py").write_text(script, encoding="utf-8")
    plain = {name: value for name, value in os.environ.items() if name not in NAMES}
    hashes = []
    for number, kernels in enumerate(("Haswell", "Prescott")):
        out = tmp_path / str(number)
        command = ["generate", "fig9_knife_edge", "--frames", "4", "--out", str(out)]
        subprocess.run(
            [sys.executable, str(tmp_path / "command.py"), *command],
            env={**plain, "OPENBLAS_CORETYPE": kernels},
            check=True,
            capture_output=True,
        )
        paths = sorted(out.glob("*/shard_*/hashes.json"))
        assert paths
        hashes.append([path.read_bytes() for path in paths])
    assert hashes[0] == hashes[1]
