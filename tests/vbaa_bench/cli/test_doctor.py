import subprocess
from pathlib import Path

from vbaa_bench.cli.doctor import Diagnosis
from vbaa_bench.dataset.target import FAST
from vbaa_bench.render.variant import CUDA, PLAIN, Probe

ROOT = Path(__file__).parents[3]


def diagnosis(*works: str) -> Diagnosis:
    return Diagnosis(tuple(Probe(name, name in works, "") for name in (CUDA, FAST, PLAIN)))


def test_cuda_is_offered_only_where_it_works() -> None:
    assert "--variant cuda_ad_mono" in diagnosis(CUDA, FAST, PLAIN).advice
    assert "cuda_ad_mono does not work here" in diagnosis(FAST, PLAIN).advice
    assert "slower" in diagnosis(PLAIN).advice
    assert "Nothing renders" in diagnosis().advice


def test_make_clean_keeps_rendered_data() -> None:
    done = subprocess.run(
        ["make", "--dry-run", "clean"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert ".venv" in done.stdout
    assert "runs" not in done.stdout
