"""The kind of processor, which decides the last digits of linear algebra."""

import functools
import platform

import numpy as np
import threadpoolctl


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
