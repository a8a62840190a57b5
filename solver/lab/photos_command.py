"""The command `photos`: a folder of photographs in, a table of loads out."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import track

from solver.lab.console import console
from solver.lab.options import JsonOption, PageOption
from solver.lab.photos_page import page
from solver.lab.photos_table import json_line, summary, table_text
from solver.lab.writing import prepare_output_and_page, write
from solver.photographs.photo_set import Photograph
from solver.photographs.photos_json import FILE, read_photos
from solver.photographs.solve import solve_photos


def photos(
    folder: Annotated[Path, typer.Argument(help="folder of photographs, with photos.json")],
    out: Annotated[Path, typer.Option(help="CSV to write")] = Path("photos.csv"),
    web_page: PageOption = None,
    json: JsonOption = False,
) -> None:
    """Estimate loads and EI from photographs of one beam, from any poses and without a board.

    The exit status is 1 if the load of no photograph is answered.
    """
    photo_set = read_photos(folder)
    read = (folder / FILE, *(one.path for one in photo_set.photographs))
    prepare_output_and_page(out, web_page, read)

    def progress(items: Iterable[Photograph]) -> Iterable[Photograph]:
        # A mistake in an image gives one sentence, and no bar before it in a log.
        hidden = not console.is_terminal
        return track(items, "tracing", console=console, transient=True, disable=hidden)

    answer = solve_photos(photo_set, progress)
    write(out, table_text(answer).encode())
    if web_page:
        write(web_page, page(answer).encode())
    print(json_line(answer) if json else f"{summary(answer)}\nwritten to {out}")
    loads = [photo.load is not None for photo in photo_set.photographs]
    answered = [one.outcome.has_values for one in answer.answers]
    if any(loads) and not any(answered):
        raise typer.Exit(1)
