"""Workers of a real Dask cluster on the loopback interface: they die, and differ in version."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import CancelledError
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import dask
import distributed
import pytest
from distributed.scheduler import KilledWorker

from solver.instrument.errors import InputError
from tests.forgotten import forgotten
from tests.poisoned import PoisonedWorker
from tests.vbaa_bench.generation.test_failures import failures, poisoned
from tests.vbaa_bench.residents import KindsOfLight
from tests.vbaa_bench.scene.test_user_modules import GLOW, scene_under
from vbaa_bench.generation.deaths import DIED
from vbaa_bench.generation.inventory import take_inventory
from vbaa_bench.scene.user_modules import use_module
from vbaa_bench.workers import cluster
from vbaa_bench.workers.cluster import ClusterAddress, ClusterPool
from vbaa_bench.workers.jobs import Job, WorkerDiedError

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def address() -> Iterator[ClusterAddress]:
    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1"}
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(dashboard_address=None, silence_logs=50, **options) as local,
    ):
        yield ClusterAddress.checked(local.scheduler_address)


@pytest.mark.thorough
def test_a_frame_at_which_workers_of_a_cluster_die_costs_itself_alone(
    address: ClusterAddress, tmp_path: Path
) -> None:
    missing, counts = poisoned(tmp_path), list[int]()
    with ClusterPool(address, PoisonedWorker, (tmp_path,), print) as pool:
        missing.generate(pool, lambda done, _total: counts.append(done))
    assert failures(missing.layout) == {"frame 1": DIED, "frame 3": DIED}
    assert take_inventory(missing.layout, missing.contents).failed == missing.inventory.failed
    assert counts[-1] == 10
    assert not missing.layout.all_aside()


@pytest.mark.thorough
def test_a_worker_of_another_version_is_refused(
    address: ClusterAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "program_digest", lambda: "another")
    with (
        pytest.raises(InputError, match=r"worker on .*: has another version of the program"),
        ClusterPool(address, PoisonedWorker, (tmp_path,), print) as pool,
    ):
        list(pool.outcomes(deque([Job("image", ("rest/rest_00.png", 1.0))]), lambda _done: None))


@pytest.mark.thorough
def test_workers_of_a_cluster_get_users_modules(
    address: ClusterAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "glowing.py").write_text(GLOW, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with forgotten():
        use_module("glowing")
        arguments = (scene_under({"kind": "glow"}).scene,)
        (tmp_path / "glowing.py").unlink()
        with ClusterPool(address, KindsOfLight, arguments, print) as pool:
            (ended,) = pool.outcomes(deque([Job("kinds", ("",))]), lambda _done: None)
    assert ended.result == ["glow"]


class Gone:
    """The future of a job whose result is lost with its worker before it is fetched."""

    status = "finished"

    def __init__(self, ending: Exception | None) -> None:
        self._ending = ending

    def result(self) -> Any:
        if self._ending is not None:
            raise self._ending
        return SimpleNamespace(result="later", pieces=1)


def test_a_finished_result_may_still_be_lost(
    address: ClusterAddress, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = KilledWorker("run_job", None, 0)  # type: ignore[arg-type]
    futures = iter([Gone(killed), Gone(CancelledError()), Gone(None)])
    monkeypatch.setattr(ClusterPool, "_submitted", lambda _pool, _job: next(futures))
    with ClusterPool(address, PoisonedWorker, (), print) as pool:
        first, second = pool.outcomes(deque(Job("image", (n,)) for n in "ab"), lambda _done: None)
    # Dask has run the one again, which has killed the next worker; the other is submitted again.
    assert isinstance(first.death, WorkerDiedError)
    assert (second.job.arguments, second.result) == (("b",), "later")


class Waiting:
    """A client whose scheduler has some workers, and the future of a job that takes a while."""

    def __init__(self, workers: int) -> None:
        self._workers, self._polls = workers, 0

    def scheduler_info(self) -> dict[str, Any]:
        return {"workers": dict.fromkeys(range(self._workers))}

    @property
    def status(self) -> str:
        self._polls += 1
        return "pending" if self._polls < 6 else "finished"

    def result(self) -> Any:
        return SimpleNamespace(result="done", pieces=1)


@pytest.mark.parametrize("workers", [0, 1])
def test_a_cluster_without_workers_is_no_silence(
    workers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    remarks: list[str] = []
    pool = ClusterPool(ClusterAddress("tcp://here:1"), PoisonedWorker, (), remarks.append)
    waiting = Waiting(workers)
    pool._client = waiting
    monkeypatch.setattr(ClusterPool, "_submitted", lambda _pool, _job: waiting)
    monkeypatch.setattr(cluster, "REMARK_S", 0.0)
    monkeypatch.setattr(cluster, "_POLL_S", 0.001)
    (ended,) = pool.outcomes(deque([Job("image", ("a",))]), lambda _done: None)
    assert ended.result == "done"
    said = {"the scheduler at tcp://here:1 has no workers; waiting for them"}
    assert set(remarks) == (set() if workers else said)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("127.0.0.1", "allowed is an address such as tcp://127.0.0.1:8786, or a file"),
        ("none.yaml", r"none\.yaml: cannot be read"),
        ("[1, 2]", "is no mapping"),
        ("cluster: cloud", "cluster is cloud, allowed is one of slurm, pbs"),
        ("cluster: slurm\njobs: many", "jobs is many, allowed is a number"),
        ("cluster: slurm\njobs: 2\ncores: 0", "cores is 0, allowed is a number"),
    ],
)
def test_an_address_is_checked_before_anything_is_started(
    text: str, message: str, tmp_path: Path
) -> None:
    if ":" in text or "[" in text:
        (tmp_path / "cluster.yaml").write_text(text)
        text = str(tmp_path / "cluster.yaml")
    with pytest.raises(InputError, match=message):
        ClusterAddress.checked(text)


# dask-jobqueue leaves the pipes of its local processes open.
@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_file_starts_its_own_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A worker imports nothing from the folder where it starts, and the test's object is not
    # installed.
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    path = tmp_path / "here.yaml"
    path.write_text("cluster: local\njobs: 1\nmemory: 1GB\n")
    with ClusterPool(ClusterAddress.checked(str(path)), PoisonedWorker, (tmp_path,), print) as pool:
        jobs = deque([Job("image", ("view", 1.0))])
        for ended in pool.outcomes(jobs, lambda _done: None):
            if ended.death is not None:  # on a busy machine the first worker may be late
                jobs.append(ended.job)
    assert ended.result == "view at 1.0"
