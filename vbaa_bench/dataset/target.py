"""The processor that kernels are compiled for, on which the last digits of a dataset depend.

Dr.Jit compiles for the processor it runs on, with vectors of 4, 8 or 16 values, and each width
rounds differently: two machines would render two datasets from one seed. All machines of one
architecture therefore compile for one *reference target*, unless NATIVE is asked for.
"""

import functools
import os
import platform
from typing import Final, NamedTuple

import numpy as np
import threadpoolctl

FAST: Final = "llvm_ad_mono"
# Mitsuba's FAST, compiled for the very processor it runs on.
NATIVE: Final = "llvm_native"

# The tests render with vectors of another number of values as well.
_WIDTH_VARIABLE: Final = "VBAA_BENCH_VECTOR_WIDTH"


class Target(NamedTuple):
    """A processor that kernels are compiled for, by LLVM's name, and the width of its vectors."""

    processor: str
    width: int

    def __str__(self) -> str:
        return f"{self.processor}, vectors of {self.width}"


# Without an entry, an architecture compiles for its own processors.
_REFERENCE_WIDTH: Final = {"x86_64": 8, "AMD64": 8}
# The oldest processors with vectors of a width: those of the last ten years have 8 values.
_X86: Final = {4: "x86-64-v3", 8: "x86-64-v3", 16: "x86-64-v4"}


def reference_target(variant: str) -> Target | None:
    """Return the target that a variant is compiled for; None where Dr.Jit chooses its own."""
    width = _REFERENCE_WIDTH.get(platform.machine()) if variant == FAST else None
    if width is None:
        return None
    width = int(os.environ.get(_WIDTH_VARIABLE, width))
    return Target(_X86[width], width)


def target(variant: str) -> str:
    """Name the target of a variant of Mitsuba. Machines with the same one share a dataset."""
    reference = reference_target(variant)
    if reference is not None:
        return str(reference)
    return processor() if variant in (FAST, NATIVE) else platform.machine()


@functools.cache
def processor() -> str:
    """Name the processor's family and the kernels that linear algebra uses on it.

    Two processors with the same name give the same bytes, such as x86_64 SkylakeX.
    """
    np.linalg.norm(np.ones(2))  # loads the library
    kernels = {
        library["architecture"]
        for library in threadpoolctl.threadpool_info()
        if library.get("user_api") == "blas" and library.get("architecture")
    }
    return " ".join([platform.machine(), *sorted(kernels)])
