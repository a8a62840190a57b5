"""Commands on existing datasets: verify, info, subset; and the schema of all."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from solver.instrument.errors import InputError
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import (
    METHODS,
    AsJson,
    DatasetPath,
    Modules,
    SceneOption,
    Workers,
    parsed_range,
)
from vbaa_bench.report.console import (
    console,
    print_line,
    print_result,
    progress_bar,
    progress_bars,
    show_table,
)

if TYPE_CHECKING:
    from vbaa_bench.benchmarks.leaks import LeakTest


class Page(StrEnum):
    """Name of a page of the schema."""

    COLUMNS = "columns"
    FORMAT = "format"
    SCENE = "scene"


def verify(
    dataset: DatasetPath,
    repair: Annotated[
        bool, typer.Option("--repair", help="render damaged files again, remove surplus files")
    ] = False,
    scene: SceneOption = None,
    _module: Modules = None,
    against: Annotated[
        str | None,
        typer.Option(help="digest that the dataset must have, which generate has printed"),
    ] = None,
    leaks: Annotated[
        bool,
        typer.Option(
            "--leaks", help="test whether order, names, image files or encoder predict the contact"
        ),
    ] = False,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Name everything that is wrong in a dataset or collection, in one pass.

    The exit status is 1 if anything is wrong. Damaged results must be computed again: the command
    is printed. With --leaks it is also 1 if a feature is better than chance; by chance, one clean
    feature in a hundred is.
    """
    with importing():
        from vbaa_bench.api.verification import verify as verify_dataset

    with progress_bars() as bars:

        def on_fault(sentence: str) -> None:
            if not as_json:
                print_line(sentence)

        result = verify_dataset(
            dataset,
            METHODS,
            repair=repair,
            scene=scene,
            against=against,
            workers=workers,
            on_shard=progress_bar(bars, "verifying"),
            on_fault=on_fault,
            on_frame=progress_bar(bars, "rendering", hidden=True),
        )
    tests = _leak_tests(dataset) if leaks else []
    features = {"features": [test.record() for test in tests]} if leaks else {}
    print_result({**result.record(), **features}, str(result), as_json)
    if leaks and not as_json:
        _show_leak_tests(tests)
    if result.faults or not all(test.passes for test in tests):
        raise typer.Exit(1)


def _leak_tests(dataset: Path) -> "list[LeakTest]":
    with importing():
        from vbaa_bench.benchmarks.leaks import find_leaks

    with console.status("searching for leaks"):
        return find_leaks(dataset)


def _show_leak_tests(tests: "list[LeakTest]") -> None:
    show_table(
        "held-out R^2 of x_c over beam length",
        ("feature", "frames", "R^2", "99 % of permutations", "passes"),
        [
            (
                test.feature,
                str(test.frames),
                f"{test.r_squared:.4f}",
                f"{test.chance:.4f}",
                "yes" if test.passes else "no",
            )
            for test in tests
        ],
    )


def info(dataset: DatasetPath, as_json: AsJson = False) -> None:
    """Print the facts on a dataset or collection: frames, failures, splits, versions, results."""
    with importing():
        from vbaa_bench.dataset.info import info_of

    facts = info_of(dataset)
    lines = list(facts.lines())
    width = max(len(name) for name, _ in lines)
    text = "\n".join(f"{name:{width}}  {value}" for name, value in lines)
    print_result(facts.record(), text, as_json)


def subset(
    dataset: DatasetPath,
    out: Annotated[Path, typer.Argument(help="new folder")],
    frames: Annotated[
        int | None, typer.Option(min=1, help="largest number of frames, of whole pushes")
    ] = None,
    split: Annotated[str | None, typer.Option(help="name of a split")] = None,
    shards: Annotated[
        str | None, typer.Option(help="shards, as 7 or 0:10 (0 to 9); pushes may be cut")
    ] = None,
    cut_pushes: Annotated[
        bool, typer.Option("--cut-pushes", help="with --frames: exactly this number of frames")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Copy some frames of a dataset into a new dataset, which is solved and scored as any other."""
    with importing():
        from vbaa_bench.api.export import subset as write_subset
        from vbaa_bench.dataset.collection import count_frames

    chosen = None if shards is None else shard_range(shards)
    with console.status("copying"):
        write_subset(dataset, out, frames=frames, split=split, shards=chosen, cut_pushes=cut_pushes)
    count = count_frames(out).frames
    print_result({"dataset": str(out), "frames": count}, f"{count} frames in {out}", as_json)


def shard_range(text: str) -> tuple[int, int]:
    """Parse the shards of `subset`, the first and the one after the last. Raises InputError."""
    chosen = parsed_range(text)
    if chosen is None or chosen.stop is None:
        raise InputError(f"--shards is {text}, allowed is a number or a range such as 0:10")
    if chosen.start >= chosen.stop:
        raise InputError(f"--shards is {text}, allowed is a range such as 0:10")
    return chosen.start, chosen.stop


def schema(
    page: Annotated[
        Page,
        typer.Argument(
            help="columns: the data dictionary; format: files of a dataset; scene: keys of a scene"
        ),
    ],
    as_json: AsJson = False,
) -> None:
    """Print every column of the files, the format of datasets or every key of a scene, as Markdown.

    With --json the keys of a scene are a JSON Schema, by which editors complete scene files.
    """
    with importing():
        from vbaa_bench.report import dictionary, format_page, scene_keys
        from vbaa_bench.scene.json_schema import file_schema

    if not as_json:
        pages = {
            Page.COLUMNS: dictionary.page,
            Page.FORMAT: format_page.page,
            Page.SCENE: scene_keys.page,
        }
        print(pages[page](), end="")
        return
    records: dict[Page, Callable[[], dict[str, Any]]] = {
        Page.COLUMNS: dictionary.record,
        Page.FORMAT: lambda: {"page": format_page.page()},
        Page.SCENE: file_schema,
    }
    print_result(records[page](), "", True)
