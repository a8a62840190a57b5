"""Kernels of OpenBLAS and NumPy that are the same on every processor.

Both choose their code by the processor's vectors, and the last digits of their results differ:
with other kernels, tens of pixels of an image have another gray value. Processes that make data use
the kernels of x86-64-v3, the renderer's reference target; processors without it keep their own.
"""

import contextlib
import os
from collections.abc import Iterator
from typing import Final

import cv2

# Numbers of instruction sets in OpenCV's interface (CV_CPU_AVX2 and so on), for which Python has
# no names.
_AVX2: Final = 11
_FMA3: Final = 12
_AVX_512F: Final = 13


def reference_variables() -> dict[str, str]:
    """Return the variables of the environment that choose these kernels for a new process.

    Those that the user has set are left out: the choice is kept.
    """
    names = {}
    if cv2.checkHardwareSupport(_AVX2) and cv2.checkHardwareSupport(_FMA3):
        names["OPENBLAS_CORETYPE"] = "Haswell"
    if cv2.checkHardwareSupport(_AVX_512F):
        names["NPY_DISABLE_CPU_FEATURES"] = "X86_V4 AVX512_ICL AVX512_SPR"
    return {name: value for name, value in names.items() if name not in os.environ}


@contextlib.contextmanager
def reference_kernels() -> Iterator[None]:
    """Let processes that are started here use these kernels."""
    added = reference_variables()
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
