"""Choice of the Mitsuba variant that runs on this machine.

A libLLVM that Dr.Jit cannot use may abort the whole process, which no `except` catches. Every
variant is therefore tried in a child process first.
"""

import ctypes
import functools
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.safe_path import PYTHON
from vbaa_bench.dataset.target import FAST, NATIVE, Target, reference_target

CUDA: Final = "cuda_ad_mono"
PLAIN: Final = "scalar_rgb"
VARIANTS: Final = (CUDA, FAST, NATIVE, PLAIN)

ADVICE: Final = (
    "Dr.Jit needs libatomic, and for its fast variant libLLVM 16 or newer: on Debian and Ubuntu, "
    "apt-get install libatomic1 libllvm19; elsewhere, set DRJIT_LIBLLVM_PATH to such a libLLVM.so"
)

_PROBE = """
import json, sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({"type": "scene", "light": {"type": "constant"}, "ball": {"type": "sphere"},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 8}},
    "integrator": {"type": "direct"}})
image = mi.render(scene, spp=1).numpy()
print()  # a progress bar may stand on this line
print("probe", json.dumps({"mitsuba": mi.__version__, "finite": bool((image >= 0).all())}))
"""


# Exit status after SIGKILL. It comes from a person or a lack of memory, never from a variant that
# does not work: the probe is then repeated once.
_KILLED: Final = -9
# Exit status after SIGILL.
_ILLEGAL: Final = -4


@dataclass(frozen=True)
class Probe:
    """Result of rendering with a variant in a child process: the version, or the error."""

    variant: str
    works: bool
    message: str


def probe(variant: str) -> Probe:
    """Render a tiny image with `variant` in a child process."""
    try:
        child = _rendered(variant)
        if child.returncode == _KILLED:
            child = _rendered(variant)
    except subprocess.TimeoutExpired:
        return Probe(variant, False, "timed out after 120 s")
    lines = (child.stderr.strip() or child.stdout.strip()).splitlines()
    # A missing library causes all later messages.
    missing = [line for line in lines if "cannot open shared object file" in line]
    message = (missing or lines[-1:] or [""])[0].strip()
    results = [line for line in child.stdout.splitlines() if line.startswith("probe ")]
    if child.returncode == _ILLEGAL:
        message = "mitsuba or drjit needs instructions that this processor lacks"
    if child.returncode != 0 or not results:
        return Probe(variant, False, f"{message} (exit status {child.returncode})")
    result = json.loads(results[-1].removeprefix("probe "))
    return Probe(variant, bool(result["finite"]), f"mitsuba {result['mitsuba']}")


def _rendered(variant: str) -> subprocess.CompletedProcess[str]:
    command = [*PYTHON, "-c", _PROBE, _mitsuba_name(variant)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def activate(variant: str, threads: int, *, colour: bool = False) -> None:
    """Set Mitsuba's variant and target for this process, and the threads of its kernels.

    Images are gray, or have the variant's `colour`.
    """
    import drjit  # imported late: choosing a variant must not load the renderer
    import mitsuba

    name = _mitsuba_name(variant)
    mitsuba.set_variant(name.replace("_mono", "_rgb") if colour else name)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)  # else its progress bars mix with ours
    drjit.set_thread_count(threads)
    # Its reciprocal square roots are approximations that differ between makers of processors.
    drjit.set_flag(drjit.JitFlag.FastMath, False)
    if name == FAST:
        _compile_for(reference_target(variant))


def _compile_for(target: Target | None) -> None:
    """Set the target of Dr.Jit's kernels; None is the one that Dr.Jit chose at its start."""
    own = _own_target()
    processor, features, width = own if target is None else (target.processor, None, target.width)
    # Dr.Jit exports it in C++ only:
    # void jit_llvm_set_target(const char *cpu, const char *features, uint32_t vector_width).
    compile_for = _core()._Z19jit_llvm_set_targetPKcS0_j
    compile_for.argtypes = ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint
    compile_for.restype = None
    compile_for(processor.encode(), features and features.encode(), width)


class _OwnTarget(NamedTuple):
    """LLVM's names of this machine's processor and of its features, and the width of vectors."""

    processor: str
    features: str
    width: int


@functools.cache
def _own_target() -> _OwnTarget:
    """Read the target that Dr.Jit chose at its start. First called before another one is set."""
    core = _core()
    processor, features = core._Z19jit_llvm_target_cpuv, core._Z24jit_llvm_target_featuresv
    processor.restype = features.restype = ctypes.c_char_p
    width = core._Z21jit_llvm_vector_widthv
    width.restype = ctypes.c_uint
    return _OwnTarget(processor().decode(), features().decode(), int(width()))


def _core() -> ctypes.CDLL:
    """Open the library of Dr.Jit that is loaded already."""
    import drjit  # imported late, as above

    suffix = "dylib" if sys.platform == "darwin" else "so"
    return ctypes.CDLL(str(Path(drjit.__file__).parent / f"libdrjit-core.{suffix}"))


def _mitsuba_name(variant: str) -> str:
    return FAST if variant == NATIVE else variant


def is_scalar() -> bool:
    """Return whether the active variant traces one ray at a time."""
    import mitsuba  # imported late, as above

    return str(mitsuba.variant()).startswith("scalar")


def uses_optix() -> bool:
    """Return whether the active variant traces rays by OptiX, on a GPU.

    Measured with Mitsuba 3.9.1 and Dr.Jit 1.5.0 on an NVIDIA H200: a kernel that traces rays in two
    scenes warns, and finds no surfaces; a frozen function that traces rays ends the process when
    it is called again after vertices have moved.
    """
    import mitsuba  # imported late, as above

    return str(mitsuba.variant()).startswith("cuda")


def choose(requested: str | None = None) -> str:
    """Choose the variant to render with: the requested one, else the first of FAST, PLAIN to work.

    Raises InputError if the requested variant does not work here, or none does.
    """
    if requested is not None and requested not in VARIANTS:
        raise InputError(
            f"variant '{requested}' is unknown, allowed is one of {', '.join(VARIANTS)}"
        )
    failures = []
    for variant in [requested] if requested else [FAST, PLAIN]:
        result = probe(variant)
        if result.works:
            return variant
        failures.append(f"{variant} does not work here: {result.message}")
    raise InputError(". ".join([*failures, ADVICE]))
