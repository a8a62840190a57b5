"""Frozen digests of a suite's datasets: proof that frames are those of the suite.

The file `<version>.digests.json` beside a suite has two digests of each frozen dataset, made on the
suite's reference target:

- `digest` is that of the whole dataset, which `generate` prints. It also depends on the versions of
  the code and of packages, which the truth records.
- `frames` is that of the nominal rig, images, readings and labels alone: the lines of
  observations/hashes.json and of truth/shard_*/hashes.json of every rig, sorted by name. Another
  version of the program that renders the same frames gives the same one.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_text
from solver.instrument.hashes import HASHES, digest
from vbaa_bench.api.verification import verify as verify_dataset
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.document import (
    Document,
    as_in_file,
    check_document,
    differences,
    listing,
    read_json,
)
from vbaa_bench.dataset.overall_digest import dataset_digest
from vbaa_bench.dataset.scene_files import file_digests
from vbaa_bench.suite.folder import SuiteFolder, rigs_of
from vbaa_bench.suite.specification import Entry, Reference, Suite

NOT_FROZEN: Final = "the suite has no digests of it"


class Digests(Document):
    """The digests of a dataset, see above."""

    digest: str
    frames: str


class _Frozen(Document):
    variant: str
    target: str
    datasets: dict[str, Digests]


class Verdict(NamedTuple):
    """Verdict on a dataset: `holds` is False if its frames are not the suite's."""

    key: str
    holds: bool
    sentence: str


def frames_digest(root: Path) -> str:
    """Compute the digest of images, readings and labels. Raises InputError."""
    try:
        paths = [
            path
            for layout in rigs_of(root)
            for path in (layout.hashes, *layout.truth.glob(f"shard_*/{HASHES}"))
        ]
        named = {path.relative_to(root).as_posix(): path for path in paths}
        lines = [f"{sha256(path)}  {name}\n" for name, path in sorted(named.items())]
    except OSError as error:
        raise InputError(f"{root}: cannot be read ({error.strerror})") from error
    return digest("".join(lines).encode())


def read_frozen(suite: Suite) -> dict[str, Digests]:
    """Read the frozen digests of a suite by dataset; none without a file. Raises InputError."""
    if not suite.digests.is_file():
        return {}
    frozen = check_document(suite.digests, read_json(suite.digests), _Frozen)
    reference = suite.content.reference
    if (frozen.variant, frozen.target) != (reference.variant, reference.target):
        raise InputError(
            f"{suite.digests}: is of {frozen.variant} for {frozen.target}, allowed is "
            f"{reference.variant} for {reference.target}, the reference of the suite"
        )
    return frozen.datasets


def verify_suite(
    folder: SuiteFolder,
    tracks: tuple[str, ...] = (),
    on_fault: Callable[[str], None] = lambda _line: None,
) -> Iterator[Verdict]:
    """Verify the datasets of these tracks, or of all that have any in the folder.

    Files are compared with their hashes, the scene with that of the suite, and the digests with the
    frozen ones if the dataset was made on the reference target. `on_fault` receives every fault of
    a file. Raises InputError.
    """
    frozen = read_frozen(folder.suite)
    made = {entry.key for entry in folder.entries_made()}
    present = tuple(dict.fromkeys(entry.track for entry in folder.entries_made()))
    if not (tracks or present):
        raise InputError(f"{folder.root}: holds no dataset of the suite; run it first")
    for entry in folder.suite.entries(tracks or present):
        if entry.key not in made:
            yield Verdict(entry.key, False, "is missing; run the suite")
        else:
            yield _verdict(folder, entry, frozen.get(entry.key), on_fault)


def freeze(folder: SuiteFolder, tracks: tuple[str, ...]) -> list[str]:
    """Add the digests of complete datasets to the file beside the suite; return their names.

    Raises InputError for a dataset that was not made on the reference target, is not that of the
    suite, or has another digest already.
    """
    suite, frozen = folder.suite, read_frozen(folder.suite)
    added = []
    for entry in suite.entries(tracks):
        root = folder.results(entry).root
        verdict = _verdict(folder, entry, frozen.get(entry.key), lambda _line: None)
        if not verdict.holds:
            raise InputError(f"{root}: cannot be frozen: {verdict.sentence}")
        made_with, reference = _made_with(root), _named(suite.content.reference)
        if made_with != reference:
            raise InputError(
                f"{root}: cannot be frozen: was made with {made_with}, allowed is {reference}"
            )
        if entry.key not in frozen:
            frozen[entry.key] = Digests(digest=dataset_digest(root), frames=frames_digest(root))
            added.append(entry.key)
    order = [entry.key for entry in suite.entries() if entry.key in frozen]
    document = {
        **suite.content.reference.model_dump(),
        "datasets": {key: frozen[key].model_dump() for key in order},
    }
    write_text(suite.digests, json.dumps(document, indent=1) + "\n")
    return added


def _verdict(
    folder: SuiteFolder, entry: Entry, frozen: Digests | None, on_fault: Callable[[str], None]
) -> Verdict:
    root = folder.results(entry).root
    result = verify_dataset(root, on_fault=on_fault)
    if result.faults or result.digest is None:
        return Verdict(entry.key, False, f"has {len(result.faults)} faults: run the suite again")
    if changed := _other_scene(folder, entry):
        return Verdict(entry.key, False, f"is of another scene than the suite's ({changed})")
    reference, made_with = folder.suite.content.reference, _made_with(root)
    if frozen is not None and result.digest == frozen.digest:
        return Verdict(entry.key, True, f"is the suite's, digest {result.digest}")
    if frozen is not None and frames_digest(root) == frozen.frames:
        sentence = "frames are the suite's; its digests are of another version of the program"
        return Verdict(entry.key, True, sentence)
    own = "scene, seed and files are the suite's"
    if frozen is None:
        return Verdict(entry.key, True, f"{own}; {NOT_FROZEN}")
    if made_with != _named(reference):
        sentence = (
            f"{own}; made with {made_with}, whose bytes are not those of {_named(reference)}: "
            "some pixels differ by rounding, see results/same_bytes"
        )
        return Verdict(entry.key, True, sentence)
    return Verdict(entry.key, False, f"frames are not the suite's, digest {result.digest}")


def _other_scene(folder: SuiteFolder, entry: Entry) -> str:
    """List the keys in which a dataset's scene differs from that of the suite; "" if in none."""
    root, file = folder.results(entry).root, folder.suite.scene(entry)
    recorded: dict[str, Any]
    if entry.dataset.rigs is None:
        (layout,) = rigs_of(root)
        identity = read_json(layout.identity)
        recorded = {"scene": identity.get("scene"), "files": identity.get("files")}
        wanted: Any = file.scene.model_dump(mode="json", exclude={"title"})
    else:
        collection = CollectionLayout(root)
        recorded = {"scene": collection.read_scene(), "files": collection.read_files()}
        wanted = file.template
    here = as_in_file({"scene": wanted, "files": file_digests(file)})
    return listing(list(differences(recorded, here)))


def _made_with(root: Path) -> str:
    """Name the variants and targets of all rigs of a dataset."""
    names = set()
    for layout in rigs_of(root):
        made_with = read_json(layout.identity).get("made_with", {})
        names.add(f"{made_with.get('variant')} for {made_with.get('target')}")
    return ", ".join(sorted(names))


def _named(reference: Reference) -> str:
    return f"{reference.variant} for {reference.target}"
