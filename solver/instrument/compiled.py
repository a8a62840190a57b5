"""numba's `njit`, which keeps compiled code in one folder per state of the sources.

By itself numba compares only the file in which a function is defined, and would use outdated code
after a change of another file whose functions or constants it uses. All modules import `njit` from
here.
"""

import functools
import hashlib
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar, overload

import numba

from solver.instrument.syntax import kept_result, syntax_digests

# Value of the option `fastmath`: reordered sums and fused products let loops run in vector
# registers; NaN and infinity are still allowed.
FAST: Final = {"reassoc", "contract", "nsz", "arcp"}
F = TypeVar("F", bound=Callable[..., Any])
_SETTINGS: Final = vars(numba.config)
# A folder that the user has chosen.
_CHOSEN: Final = _SETTINGS["CACHE_DIR"]


@overload
def njit(function: F) -> F: ...
@overload
def njit(**options: Any) -> Callable[[F], F]: ...
def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function at its first call, or load it if its sources have not changed.

    Divisions by zero give infinity or NaN. `options` are numba's; a function with `inline` is
    compiled as a part of its callers. No C callback is compiled, which nothing here calls.
    """
    if function is None:
        return functools.partial(njit, **options)
    compiler: Any = numba.njit  # numba's stubs lack no_cfunc_wrapper
    if "inline" in options:
        return compiler(function, **options)
    package = sys.modules[function.__module__.partition(".")[0]].__file__
    _SETTINGS["CACHE_DIR"] = _CHOSEN or (_folder(Path(package).parent) if package else "")
    options |= {"error_model": "numpy", "no_cfunc_wrapper": True}
    try:
        return compiler(function, cache=True, **options)
    except RuntimeError as error:  # numba finds no folder that it can write to
        if "no locator" not in str(error):
            raise
        _say_not_kept()
        return compiler(function, **options)


@functools.cache
def _say_not_kept() -> None:
    """Say once that this process compiles for itself."""
    print(
        "compiled code cannot be kept, because neither the package's folder nor a home can be "
        "written to: every start takes minutes; set NUMBA_CACHE_DIR to a folder",
        file=sys.stderr,
    )


@functools.cache
def _folder(package: Path) -> str:
    """Name the folder of a package's compiled code after all sources that it depends on.

    Remove older folders. Return "", numba's own choice, if the package is not writable.
    """
    cache, own = package / "__pycache__", Path(__file__).parents[1]
    if not os.access(package, os.W_OK):
        return ""
    roots = sorted({package, own})

    def digest() -> str:
        digests: dict[str, str] = {}
        for root in roots:
            for path in sorted(root.rglob("*.py")):
                if b"@njit" in path.read_bytes():
                    module = ".".join(path.relative_to(root.parent).with_suffix("").parts)
                    digests |= syntax_digests([module], root.parent, {root.name}, digests)
        return hashlib.sha256("".join(digests.values()).encode()).hexdigest()[:12]

    folder = cache / f"compiled-{kept_result(package, 'syntax', roots, digest)}"
    if not folder.is_dir():
        for older in set(cache.glob("compiled-*")) - {folder}:
            shutil.rmtree(older, ignore_errors=True)
    return str(folder)


def compiled_functions() -> set[str] | None:
    """List the functions of this package whose compiled code is on the disk: `module.function`.

    Return None if numba keeps its code elsewhere, as for a package that is not writable.
    """
    folder = _CHOSEN or _folder(Path(__file__).parents[1])
    if not folder:
        return None
    return {path.name.partition("-")[0] for path in Path(folder).rglob("*.nbi")}
