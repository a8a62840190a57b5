"""One digest over a whole dataset or collection."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES
from tests.sealing import reseal
from tests.vbaa_bench.exports.written import Size, write_collection, write_dataset
from vbaa_bench.api.verification import verify
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.overall_digest import dataset_digest
from vbaa_bench.exports.croissant import write_croissant
from vbaa_bench.exports.export import export


def edit_readings(layout: Layout) -> None:
    path = layout.shard(layout.observations, 0) / "metadata.csv"
    path.write_text(f"{path.read_text().rstrip()}1\n", encoding="utf-8")  # a digit more


def edit_manifest(layout: Layout) -> None:
    document = json.loads(layout.manifest.read_text())
    layout.manifest.write_text(json.dumps(document | {"seed": 7}), encoding="utf-8")


def remove_an_image(layout: Layout) -> None:
    (layout.observations / "rest" / "rest_00.png").unlink()


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(write_dataset(tmp_path / "set"))


@pytest.mark.parametrize("edit", [edit_readings, edit_manifest, remove_an_image])
def test_an_edit_with_rewritten_hashes_is_noticed_by_the_digest_alone(
    layout: Layout, edit: Callable[[Layout], None]
) -> None:
    before = verify(layout.root).faults
    noted = dataset_digest(layout.root)
    assert verify(layout.root, against=noted.upper()).faults == before
    edit(layout)
    reseal(layout)
    assert verify(layout.root).faults == before
    result = verify(layout.root, against=noted)
    (fault,) = [one for one in result.faults if one not in before]
    assert str(fault) == f"{layout.root}: has the digest {result.digest}, not {noted}"


def test_standard_tools_print_the_same_digest(layout: Layout, tmp_path: Path) -> None:
    def printed(command: str, folder: Path) -> str:
        done = subprocess.run(
            ["bash", "-c", command], cwd=folder, capture_output=True, text=True, check=True
        )
        return done.stdout.split()[0]

    _, of_dataset, of_collection = [
        line.strip()
        for line in (dataset_digest.__globals__["__doc__"] or "").splitlines()
        if "sha256sum" in line
    ]
    assert printed(of_dataset, layout.root) == dataset_digest(layout.root)
    root = write_collection(tmp_path / "rigs", [Size(), Size()])
    (root / HASHES).write_text("{}", encoding="utf-8")
    assert printed(of_collection, root) == dataset_digest(root)


def test_an_incomplete_dataset_has_no_digest(layout: Layout) -> None:
    noted = dataset_digest(layout.root)
    layout.hashes.unlink()
    with pytest.raises(InputError, match=r"is incomplete|is not a dataset"):
        dataset_digest(layout.root)
    result = verify(layout.root, against=noted)
    assert result.digest is None
    assert any("has no digest, as it is incomplete, not" in str(one) for one in result.faults)


@pytest.mark.parametrize("text", ["", "12", "g" * 64, "0" * 65])
def test_what_is_no_digest_is_refused(layout: Layout, text: str) -> None:
    with pytest.raises(InputError, match="allowed are the 64 hexadecimal digits"):
        verify(layout.root, against=text)


def test_the_card_and_the_croissant_carry_the_digest(layout: Layout, tmp_path: Path) -> None:
    digest = dataset_digest(layout.root)
    export(layout.root, "hf", tmp_path / "out", lambda *_: None)
    assert f"`{digest}`" in (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    documents = (tmp_path / "out" / "croissant.json", write_croissant(layout.root))
    for document in documents:
        assert json.loads(document.read_text())["identifier"] == f"sha256:{digest}"
    assert dataset_digest(layout.root) == digest
