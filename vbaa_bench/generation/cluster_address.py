"""Address of a Dask scheduler, or a file that describes a cluster to be started."""

import contextlib
import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from solver.instrument.errors import InputError
from solver.instrument.safe_path import safe_path

# Classes of dask-jobqueue by the value of the key `cluster`.
CLUSTERS: Final = {
    "slurm": "SLURMCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "lsf": "LSFCluster",
    "oar": "OARCluster",
    "moab": "MoabCluster",
    "htcondor": "HTCondorCluster",
    "local": "LocalCluster",
}
# Chosen: a description has a dozen lines.
_MAX_BYTES: Final = 100_000


@dataclass(frozen=True)
class ClusterAddress:
    """The text of the option --dask: an address such as tcp://127.0.0.1:8786, or a YAML file."""

    text: str

    def __str__(self) -> str:
        """Return the text."""
        return self.text

    @classmethod
    def checked(cls, text: str) -> "ClusterAddress":
        """Check the text and, if it is a file, its content, before anything is started.

        Raises InputError, also if Dask is not installed.
        """
        try:
            import distributed  # noqa: F401

            if _is_file(text):
                import dask_jobqueue  # noqa: F401
        except ImportError as error:
            raise InputError(
                f"--dask {text}: {error.name} is not installed; install vbaa-bench[cluster]"
            ) from error
        if _is_file(text):
            _described(Path(text))
        elif "://" not in text:
            raise InputError(
                f"--dask is {text}, allowed is an address such as tcp://127.0.0.1:8786, or a "
                "file *.yaml that describes a cluster"
            )
        return cls(text)

    @contextlib.contextmanager
    def scheduler(self) -> Iterator[Any]:
        """Yield what a client connects to: the address, or a cluster that ends with the block."""
        if not _is_file(self.text):
            yield self.text
            return
        description = _described(Path(self.text))
        kind, jobs = description.pop("cluster"), description.pop("jobs")
        # Each kind has a module of its own.
        started = getattr(importlib.import_module(f"dask_jobqueue.{kind}"), CLUSTERS[kind])
        with contextlib.ExitStack() as stack:
            stack.enter_context(safe_path())  # whenever a job is started again, too
            try:
                cluster = stack.enter_context(started(**description))
            except (TypeError, ValueError, OSError) as error:
                raise InputError(f"{self.text}: no cluster can be started ({error})") from error
            cluster.scale(jobs=jobs)
            yield cluster


def _is_file(text: str) -> bool:
    return Path(text).suffix in {".yaml", ".yml"}


def _described(path: Path) -> dict[str, Any]:
    """Read the description of a cluster: `cluster`, `jobs`, and arguments of dask-jobqueue.

    Each process of a job has one thread. The scheduler listens on the loopback interface, unless
    the file states an `interface` or `scheduler_options`. Raises InputError.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f"{path}: is larger than {_MAX_BYTES} bytes")
        document = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: is no mapping, allowed are the keys cluster, jobs and others")
    if document.get("cluster") not in CLUSTERS:
        raise InputError(
            f"{path}: cluster is {document.get('cluster')}, allowed is one of {', '.join(CLUSTERS)}"
        )
    jobs, cores = document.get("jobs"), document.get("cores", 1)
    for key, value in (("jobs", jobs), ("cores", cores)):
        if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= 100_000:
            raise InputError(f"{path}: {key} is {value}, allowed is a number from 1 to 100000")
    if not {"interface", "scheduler_options"} & document.keys():
        document["scheduler_options"] = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    return {"cores": cores, "processes": cores, **document}
