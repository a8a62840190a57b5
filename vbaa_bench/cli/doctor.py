"""Diagnose which renderer variants work on this machine, and what to install."""

import os
import shutil
import subprocess
from dataclasses import dataclass
from typing import Any, Final

from vbaa_bench.dataset.program import versions
from vbaa_bench.dataset.target import FAST
from vbaa_bench.render.variant import ADVICE, CUDA, PLAIN, VARIANTS, Probe, probe

PACKAGES: Final = ("libatomic1", "libllvm19")
INSTALL: Final = ("apt-get", "install", "--yes", "--no-install-recommends", *PACKAGES)


@dataclass(frozen=True)
class Diagnosis:
    """Probed variants and the advice that follows from them."""

    probes: tuple[Probe, ...]

    @property
    def healthy(self) -> bool:
        """Whether any variant renders."""
        return any(result.works for result in self.probes)

    @property
    def fast(self) -> bool:
        """Whether a vectorised variant works."""
        return any(result.works for result in self.probes if result.variant in (FAST, CUDA))

    @property
    def advice(self) -> str:
        """Next step for the user, in a sentence."""
        if not self.healthy:
            return f"Nothing renders on this machine. {ADVICE}."
        if not self.fast:
            return f"Rendering works, but about ten times slower than possible. {ADVICE}."
        if any(result.works for result in self.probes if result.variant == CUDA):
            return f"Rendering works. --variant {CUDA} renders on the GPU, which is no faster."
        return f"Rendering works, on the processor: {CUDA} does not work here."

    def record(self) -> dict[str, Any]:
        """Convert the diagnosis to a record for scripts."""
        return {
            "variants": {p.variant: {"works": p.works, "said": p.message} for p in self.probes},
            "healthy": self.healthy,
            "advice": self.advice,
            "versions": versions(),
        }


def diagnose() -> Diagnosis:
    """Probe every variant, each in its own child process."""
    return Diagnosis(tuple(probe(variant) for variant in VARIANTS))


def install_libraries() -> str:
    """Install the libraries of the fast variant with apt, if allowed; return a message."""
    if probe(FAST).works:
        return f"{FAST} works; nothing to install."
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        meanwhile = "until then scalar_rgb is used, which is slower"
        return f"{ADVICE}; {meanwhile if probe(PLAIN).works else 'until then nothing renders'}."
    steps = (("apt-get", "update", "--quiet"), INSTALL)
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for step in steps:
        result = subprocess.run(step, env=quiet, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            reason = (result.stderr.strip() or result.stdout.strip()).splitlines()[-1:]
            return f"'{' '.join(step)}' failed ({' '.join(reason)}). {ADVICE}."
    state = "works" if probe(FAST).works else "still fails"
    return f"Installed {' and '.join(PACKAGES)}; {FAST} {state}."
