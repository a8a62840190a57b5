"""Submissions: a folder with method.yaml, and predictions files or the code of a method."""

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import polars as pl
from pydantic import Field

from solver.instrument.errors import InputError, quoted
from solver.methods import METHODS
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import read_model, read_plain
from vbaa_bench.scene.part import Part
from vbaa_bench.scoring.predictions import (
    checked_predictions,
    parsed,
    read_file,
    unknown_columns,
)
from vbaa_bench.scoring.results_layout import run_name
from vbaa_bench.suite.specification import Sentence, Suite, load_suite

METHOD_FILE: Final = "method.yaml"


class Submission(Part):
    """Contents of method.yaml."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")] = Field(
        description="Name in tables; with code, also that of its module."
    )
    suite: Sentence = Field(description="Version of the suite.")
    authors: Annotated[tuple[Sentence, ...], Field(min_length=1)]
    licence: Sentence = Field(description="Licence of the method, such as Apache-2.0.")
    hardware: Sentence = Field(description="Machine on which stated times were measured.")
    link: Annotated[str, Field(pattern=r"^https?://\S+$")] | None = Field(
        default=None, description="Page of the method: code, paper or contact."
    )
    predictions: dict[str, Sentence] | None = Field(
        default=None, description="Predictions files by dataset, such as lite/quickstart."
    )
    code: str | None = Field(default=None, description="NAME:FUNCTION, in NAME.py of the folder.")

    @property
    def run_name(self) -> str:
        """Name of its predictions in the folders of datasets."""
        return self.name if self.code is None else run_name(self.code)

    @property
    def kind(self) -> str:
        """Kind of the submission: code or predictions."""
        return "predictions" if self.code is None else "code"


class Finding(NamedTuple):
    """Finding of a check; one that is not `wrong` is a remark."""

    wrong: bool
    sentence: str


def read_submission(folder: Path) -> Submission:
    """Read the method.yaml of a submission. Raises InputError with all mistakes."""
    findings = [finding.sentence for finding in check_submission(folder) if finding.wrong]
    if findings:
        raise InputError("\n".join(findings))
    return read_model(folder / METHOD_FILE, Submission)


def check_submission(folder: Path) -> list[Finding]:
    """Find everything that is missing or wrong in a submission, in one pass."""
    path = folder / METHOD_FILE
    if not path.is_file():
        return [Finding(True, f"{path}: is missing")]
    try:
        values = read_plain(path)
    except InputError as error:
        return [Finding(True, str(error))]
    findings = []
    try:
        read_model(path, Submission)
    except InputError as error:
        findings += [Finding(True, line) for line in str(error).splitlines()]
    if ("predictions" in values) == ("code" in values):
        sentence = f"{path}: states {'both' if 'code' in values else 'neither'} of predictions and "
        findings.append(Finding(True, f"{sentence}code, allowed is one of them"))
    name = values.get("name")
    if name in METHODS:
        findings.append(Finding(True, f"{path}: name is {name}, that of a method of solve"))
    if isinstance(code := values.get("code"), str):
        findings += _of_code(folder, name, code)
    try:
        suite = load_suite(str(values["suite"]))
    except KeyError:
        return findings  # is among the mistakes
    except InputError as error:
        return [*findings, Finding(True, f"{path}: {error}")]
    if isinstance(predictions := values.get("predictions"), dict):
        findings += _of_predictions(folder, suite, predictions)
    return findings


def _of_code(folder: Path, name: Any, code: str) -> Iterator[Finding]:
    """Check that the module of the submission's name is there and defines the function."""
    path = folder / METHOD_FILE
    module, colon, function = code.partition(":")
    if not colon or not function.isidentifier() or module != name:
        yield Finding(
            True,
            f"{path}: code is {quoted(code)}, allowed is {name}:FUNCTION, where {name} is the name "
            "of the submission",
        )
        return
    sources = [folder / f"{module}.py", folder / module / "__init__.py"]
    source = next((one for one in sources if one.is_file()), None)
    if source is None:
        yield Finding(True, f"{sources[0]}: is missing; code names it")
        return
    try:
        tree = ast.parse(source.read_bytes())
    except (SyntaxError, ValueError) as error:
        yield Finding(True, f"{source}: is not Python ({error})")
        return
    if function not in {name for node in ast.walk(tree) for name in _bound(node)}:
        yield Finding(True, f"{source}: does not define {function}, which code names")


def _bound(node: ast.AST) -> list[str]:
    """List the names that a statement defines: a function, a class, an import or an assignment."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.ImportFrom):
        return [alias.asname or alias.name for alias in node.names]
    return [node.id] if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else []


def _of_predictions(
    folder: Path, suite: Suite, predictions: Mapping[Any, Any]
) -> Iterator[Finding]:
    """Check the datasets that predictions are stated for, their files, and the frames in these."""
    path = folder / METHOD_FILE
    entries = {entry.key: entry for entry in suite.entries()}
    for key, name in predictions.items():
        if key not in entries:
            yield Finding(
                True,
                f"{path}: predictions of {quoted(key)} are of no dataset of the suite, allowed is "
                f"one of {', '.join(entries)}",
            )
            continue
        if not isinstance(name, str):
            continue  # is among the mistakes
        file = folder / name
        if not file.resolve().is_relative_to(folder.resolve()):
            yield Finding(True, f"{path}: predictions of {key} are outside of the folder ({name})")
            continue
        try:
            table = parsed(read_file(file), file)
            frames = checked_predictions(table, str(file))
        except InputError as error:
            yield Finding(True, str(error))
            continue
        for sentence in unknown_columns(table.columns, str(file)):
            yield Finding(False, sentence)
        # The frames of random rigs are known when these are made.
        if entries[key].dataset.rigs is None:
            shards = Frames(suite.scene(entries[key]).scene).in_shards()
            known = [frame.frame_id for shard in shards for frame in shard]
            yield from _of_frames(str(file), key, frames["frame_id"], known)
    for track in suite.content.tracks:
        needed = [entry.key for entry in suite.entries((track,))]
        absent = [key for key in needed if key not in predictions]
        if absent and len(absent) < len(needed):
            yield Finding(
                False,
                f"{path}: no predictions of {', '.join(absent)}, so that the submission is not "
                f"ranked in the track {track}",
            )


def _of_frames(source: str, key: str, predicted: pl.Series, known: list[str]) -> Iterator[Finding]:
    if predicted.is_duplicated().any():
        twice = predicted.filter(predicted.is_duplicated())[0]
        yield Finding(True, f"{source}: frame_id {quoted(twice)} occurs more than once")
    unknown = predicted.filter(~predicted.is_in(known))
    if len(unknown):
        yield Finding(
            True,
            f"{source}: frame_id {quoted(unknown[0])} and {len(unknown) - 1} more are not of {key}",
        )
    absent = len(set(known) - set(predicted))
    if absent:
        yield Finding(
            False,
            f"{source}: {absent} of {len(known)} frames of {key} are not predicted; they count as "
            "failures",
        )
