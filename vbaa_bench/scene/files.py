"""Files that a scene names: meshes, images of surfaces, environment maps."""

from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError, quoted, truncated

# Longest name, with folders. Chosen: file names can have 255 characters.
MAX_NAME_LENGTH: Final = 250


def file_of_scene(folder: Path, name: str) -> Path:
    """Return the path of a file that a scene names, which must be within the scene's folder.

    Subfolders are allowed; absolute paths, `..` and links that lead out of it are not: a scene
    from elsewhere must not copy other files of this machine into a dataset.

    Raises InputError.
    """
    if len(name) > MAX_NAME_LENGTH:
        raise InputError(
            f"{truncated(name)}: has {len(name)} characters, allowed are {MAX_NAME_LENGTH}"
        )
    path = folder / name
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError) as error:  # an invalid name, or a loop of links
        raise InputError(f"{folder}: {quoted(name)} is not a file name") from error
    if not inside:
        raise InputError(
            f"{name}: is outside of the scene's folder {folder}, allowed is a file within it"
        )
    return path
