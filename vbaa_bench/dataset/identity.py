"""Identity of a dataset: its scene and the program that makes it. `generate` rejects mismatches."""

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, Literal

from solver.instrument.errors import InputError
from solver.instrument.files import holds, read_regular, write_bytes
from solver.instrument.hashes import digest, parse_hashes
from vbaa_bench.dataset.document import Difference, as_in_file, differences, listing, read_json
from vbaa_bench.dataset.format_version import SCHEMA, migrated_identity, version_of
from vbaa_bench.dataset.layout import FILES, Layout
from vbaa_bench.dataset.lock import FolderError
from vbaa_bench.dataset.program import code_digests, versions
from vbaa_bench.dataset.scene_files import file_digests
from vbaa_bench.dataset.target import target
from vbaa_bench.scene.load import SceneFile

Identity = dict[str, Any]
# Key of the digests of users' modules, by name.
MODULES: Final = "modules"
# Chosen: more datasets of one scene than anyone keeps in one folder.
_LARGEST_FORK: Final = 1000


class OtherDatasetError(FolderError):
    """Error for a folder that holds something else than the dataset or collection to be made."""


def dataset_identity(file: SceneFile, variant: str) -> Identity:
    """Collect everything that the bytes of a dataset depend on, without the scene's title.

    Users' modules are stated where the scene has or may draw a kind of theirs. Raises
    SceneFileError if a file that the scene names or may draw cannot be read.
    """
    modules = file.user_modules
    return {
        "schema": SCHEMA,
        "scene": file.scene.model_dump(mode="json", exclude={"title"}),
        FILES: file_digests(file),
        **({MODULES: modules} if modules else {}),
        "made_with": {"variant": variant, "target": target(variant), **versions()},
        "code": code_digests(),
    }


def check_identity(layout: Layout, here: Identity) -> Literal["empty", "same", "smaller"]:
    """Check that the folder is empty or holds a dataset of identity `here`.

    A smaller dataset, with fewer random pushes than `here`, can grow. A damaged identity.json is
    rewritten if the hashes show that it had this content. Raises OtherDatasetError for a folder
    that holds other files or a subset, and for a dataset of another scene, seed, program or
    machine; the message names the differences.
    """
    path, data = layout.identity, _encoded(here)
    if holds(path, data):
        return "same"
    recorded = layout.truth / layout.hashes.name
    table = (parse_hashes(read_regular(recorded)) if recorded.is_file() else None) or {}
    if table.get(path.name) == digest(data):
        write_bytes(path, data)
        return "same"
    if not path.is_file():
        foreign_file = next(_contents(layout), None)
        if foreign_file is not None:
            raise OtherDatasetError(
                f"{layout.root}: holds other files ({foreign_file}); choose an empty folder"
            )
        return "empty"
    document = read_json(path)
    if "subset" in document:
        raise OtherDatasetError(
            f"{layout.root}: is a subset of another dataset, which cannot be generated or grown; "
            "make it again with vbaa-bench subset"
        )
    identity = migrated_identity(path, document)
    if version_of(path, document) == SCHEMA and _grows(identity, here):
        return "smaller"
    raise OtherDatasetError(_refusal(layout, identity, here))


def _grows(recorded: Identity, here: Identity) -> bool:
    """Test whether a dataset becomes one with identity `here` by adding frames."""
    sizes = {"scene.sampling.count", "scene.pushes.repeats"}
    sampling = here["scene"]["sampling"] or {}
    changed = list(differences(recorded, as_in_file(here)))
    only_size = all(
        key in sizes and isinstance(old, int) and old < new for key, old, new in changed
    )
    return bool(changed) and only_size and sampling.get("method") != "grid"


def fork_of_dataset(file: SceneFile, root: Path, variant: str) -> Path:
    """Return the first of DIR, DIR-2, DIR-3, ... that is free or holds the dataset of this scene.

    Raises InputError.
    """
    identity = dataset_identity(file, variant)
    return first_fork(root, lambda folder: check_identity(Layout(folder), identity))


def first_fork(root: Path, check: Callable[[Path], object]) -> Path:
    """Return the first of DIR, DIR-2, DIR-3, ... for which `check` raises no OtherDatasetError.

    Raises InputError.
    """
    try:
        for number in range(1, _LARGEST_FORK + 1):
            folder = root if number == 1 else root.with_name(f"{root.name}-{number}")
            with contextlib.suppress(OtherDatasetError):
                check(folder)
                return folder
    except OSError as error:
        raise InputError(f"{root}: cannot be read ({error.strerror})") from error
    raise InputError(
        f"{root}-{_LARGEST_FORK}: holds another dataset; choose another folder with --out"
    )


def write_identity(layout: Layout, identity: Identity) -> str:
    """Write identity.json unless it exists; return its sha256. Raises OSError."""
    data = _encoded(identity)
    layout.truth.mkdir(parents=True, exist_ok=True)
    if not holds(layout.identity, data):
        write_bytes(layout.identity, data)
    return digest(data)


def _encoded(identity: Identity) -> bytes:
    return (json.dumps(identity) + "\n").encode()


def _contents(layout: Layout) -> Iterator[str]:
    """List files below the root, except those left by an interrupted start of `generate`."""
    leftovers = (layout.lock.name, f".{layout.identity.name}.")
    for path in layout.root.rglob("*") if layout.root.exists() else ():
        if path.is_file() and not path.name.startswith(leftovers):
            yield path.name


def _refusal(layout: Layout, recorded: Identity, here: Identity) -> str:
    """Say in what a dataset differs from `here`: scene, its files and modules, packages, code."""
    remedy = "choose another folder with --out, start beside it with --fork, or delete this one"
    changed = {part: _changes(part, recorded, here) for part in ("scene", "files", "made_with")}
    kinds = list(differences(recorded.get(MODULES, {}), here.get(MODULES, {})))
    modules = [change.key or "an older one" for change in _changes("code", recorded, here)]
    code = [f"{len(modules)} modules of the code"] if modules else []
    if changed["files"]:
        names = listing([change.key for change in changed["files"]])
        remedy = (
            f"put back the files with which it was made, of which {layout.files} has copies, or "
            f"{remedy}"
        )
        if not changed["scene"]:
            files = f"other files than those beside the scene ({names})"
            return f"{layout.root}: was made with {files}; {remedy}"
    if changed["scene"]:
        grid = (here["scene"]["sampling"] or {}).get("method") == "grid"
        if grid and any(change.key == "sampling.count" for change in changed["scene"]):
            remedy = f"a grid cannot grow, method sobol can; {remedy}"
        texts = [*changed["scene"], *changed["files"], *kinds, *changed["made_with"], *code]
        return (
            f"{layout.root}: holds the dataset of another scene, seed or mesh ({listing(texts)}); "
            f"{remedy}"
        )
    readable = "solve, score and report can still read it"
    if kinds:
        return (
            f"{layout.root}: was made with another version of a module of kinds "
            f"({listing([*kinds, *changed['made_with'], *code])}); {readable}; to generate, "
            f"{remedy}, or restore that version"
        )
    if changed["made_with"] and "code" in recorded:
        return (
            f"{layout.root}: was begun with other packages "
            f"({listing([*changed['made_with'], *code])}); {readable}; to generate, {remedy}, or "
            "restore the original versions"
        )
    return (
        f"{layout.root}: was made by another version of the code "
        f"({listing(modules) or 'of an older format'}); {readable}; to generate, {remedy}, or "
        "restore that version"
    )


def _changes(part: str, recorded: Identity, here: Identity) -> list[Difference]:
    return list(differences(recorded.get(part), as_in_file(here[part])))
