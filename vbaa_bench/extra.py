"""The extra `bench`, without which only the antenna, `solver`, is complete."""

from typing import Final

# The modules of its packages.
MODULES: Final = (
    "OpenEXR",
    "drjit",
    "jinja2",
    "mitsuba",
    "polars",
    "pydantic",
    "ruamel",
    "threadpoolctl",
    "trimesh",
    "vl_convert",
)


def remedy(error: ModuleNotFoundError) -> str | None:
    """Return what to install in one sentence; None if the missing module is none of the extra."""
    module = (error.name or "").partition(".")[0]
    if module not in MODULES:
        return None
    return (
        f"{module} is not installed: pip install 'vbaa-bench[bench]', or '.[bench]' in a copy of "
        "the repository, adds renderer and scores"
    )
