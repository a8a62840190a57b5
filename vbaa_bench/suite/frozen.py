"""Frozen frames of a suite: the fingerprints of its datasets, made on its reference target.

They are in the file `<version>.frozen.json` beside the suite.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.files import write_text
from vbaa_bench.api.verification import verify as verify_dataset
from vbaa_bench.dataset.collection import CollectionLayout, rigs_of
from vbaa_bench.dataset.document import (
    Document,
    as_in_file,
    check_document,
    differences,
    listing,
    read_json,
)
from vbaa_bench.dataset.fingerprint import Fingerprint, compare, fingerprint
from vbaa_bench.dataset.scene_files import file_digests
from vbaa_bench.suite.folder import SuiteFolder
from vbaa_bench.suite.specification import Entry, Reference, Suite

NOT_FROZEN: Final = "the suite has no fingerprint of it"

# Smallest share of images that differ by rounding at most. Chosen: of another seed, a twentieth
# would, by chance.
_MOST: Final = 0.9


class _Frozen(Document):
    variant: str
    target: str
    datasets: dict[str, Fingerprint]


class Verdict(NamedTuple):
    """Verdict on a dataset: `holds` is False if its frames are not the suite's."""

    key: str
    holds: bool
    sentence: str


def read_frozen(suite: Suite) -> dict[str, Fingerprint]:
    """Read a suite's frozen fingerprints by dataset; none without a file. Raises InputError."""
    if not suite.frozen.is_file():
        return {}
    frozen = check_document(suite.frozen, read_json(suite.frozen), _Frozen)
    reference = suite.content.reference
    if (frozen.variant, frozen.target) != (reference.variant, reference.target):
        raise InputError(
            f"{suite.frozen}: is of {frozen.variant} for {frozen.target}, allowed is "
            f"{reference.variant} for {reference.target}, the reference of the suite"
        )
    return frozen.datasets


def verify_suite(
    folder: SuiteFolder,
    tracks: tuple[str, ...] = (),
    on_fault: Callable[[str], None] = lambda _line: None,
) -> Iterator[Verdict]:
    """Verify the datasets of these tracks, or of all that have any in the folder.

    Files are compared with their hashes, the scene with that of the suite, and their fingerprints
    with the frozen ones. `on_fault` receives every fault of a file. Raises InputError.
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
    """Add the fingerprints of complete datasets to the file beside the suite; return their names.

    Raises InputError for a dataset that was not made on the reference target, is not that of the
    suite, or has another fingerprint already.
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
            frozen[entry.key] = fingerprint(root)
            added.append(entry.key)
    order = [entry.key for entry in suite.entries() if entry.key in frozen]
    document = {
        **suite.content.reference.model_dump(),
        "datasets": {key: frozen[key].model_dump() for key in order},
    }
    write_text(suite.frozen, json.dumps(document, indent=1) + "\n")
    return added


def _verdict(
    folder: SuiteFolder,
    entry: Entry,
    frozen: Fingerprint | None,
    on_fault: Callable[[str], None],
) -> Verdict:
    root = folder.results(entry).root
    result = verify_dataset(root, on_fault=on_fault)
    if result.faults or result.digest is None:
        return Verdict(entry.key, False, f"has {len(result.faults)} faults: run the suite again")
    if changed := _other_scene(folder, entry):
        return Verdict(entry.key, False, f"is of another scene than the suite's ({changed})")
    if frozen is None:
        return Verdict(entry.key, True, f"scene, seed and files are the suite's; {NOT_FROZEN}")
    compared = compare(root, frozen)
    if compared.exact:
        sentence = f"is the suite's: all {compared.images} images have the same sums"
        return Verdict(entry.key, True, sentence)
    counted = (
        f"{compared.same} of {compared.images} images have the same sums, "
        f"{compared.rounded} but for rounding"
    )
    if compared.others and compared.rounded >= _MOST * compared.images:
        return Verdict(entry.key, True, f"frames are the suite's: {counted}")
    if not compared.others:
        counted += "; rig or readings differ"
    sentence = f"frames are not the suite's: {counted}; made with {_made_with(root)}"
    return Verdict(entry.key, False, sentence)


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
