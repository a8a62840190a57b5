"""Diagnose which renderer variants work on this machine, and what to install."""

import os
import shutil
import subprocess
from dataclasses import dataclass
from typing import Any, Final

from vbaa_bench.dataset.manifest import versions
from vbaa_bench.render.variant import ADVICE, CUDA, FAST, PLAIN, VARIANTS, Probe, probe

PACKAGES: Final = ("libatomic1", "libllvm19")
INSTALL: Final = ("apt-get", "install", "--yes", "--no-install-recommends", *PACKAGES)


@dataclass(frozen=True)
class Diagnosis:
    """Probed variants and the advice that follows from them."""

    probes: tuple[Probe, ...]

    @property
    def healthy(self) -> bool:
        """Whether any variant renders."""
        return any(found.works for found in self.probes)

    @property
    def fast(self) -> bool:
        """Whether a vectorised variant works."""
        return any(found.works for found in self.probes if found.variant in (FAST, CUDA))

    @property
    def advice(self) -> str:
        """Next step for the user, in a sentence."""
        if not self.healthy:
            return f"Nothing renders here. {ADVICE}."
        if not self.fast:
            return f"Everything runs, but about ten times slower than it could. {ADVICE}."
        if any(found.works for found in self.probes if found.variant == CUDA):
            return f"All is well. CUDA is used when asked for: --variant {CUDA}."
        return f"All is well, on the processor: {CUDA} does not work here."

    def record(self) -> dict[str, Any]:
        """Convert the diagnosis to a record for scripts."""
        return {
            "variants": {p.variant: {"works": p.works, "said": p.said} for p in self.probes},
            "healthy": self.healthy,
            "advice": self.advice,
            "versions": versions(),
        }


def diagnose() -> Diagnosis:
    """Probe every variant, each in its own child process."""
    return Diagnosis(tuple(probe(variant) for variant in VARIANTS))


def install_libraries() -> str:
    """Install by apt what the fast variant needs, where allowed; return a sentence about it."""
    if probe(FAST).works:
        return f"{FAST} works; nothing to install."
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        until = "until then everything runs on scalar_rgb, slower"
        return f"{ADVICE}; {until if probe(PLAIN).works else 'until then nothing renders'}."
    steps = (("apt-get", "update", "--quiet"), INSTALL)
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for step in steps:
        done = subprocess.run(step, env=quiet, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            reason = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
            return f"'{' '.join(step)}' failed ({' '.join(reason)}). {ADVICE}."
    state = "works" if probe(FAST).works else "still fails"
    return f"Installed {' and '.join(PACKAGES)}; {FAST} {state}."
