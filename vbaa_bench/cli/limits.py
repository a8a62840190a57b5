"""The command limits: of a scene as maps, or of the frames of a dataset."""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, Modules, SceneOrDataset, Seed, Settings, Variant, Workers
from vbaa_bench.report.console import (
    late_bars,
    print_line,
    print_result,
    progress_bar,
    progress_bars,
    show_table,
)


def limits(
    source: SceneOrDataset,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="values to compare: beam.diameter_mm=0.4,0.8; of keys that change together: "
            "camera.width_px+camera.height_px=256,512 or =256+192,512+384; repeatable"
        ),
    ] = None,
    require: Annotated[
        list[str] | None,
        typer.Option(help="largest standard deviations: x_c_pct_L=0.1,force_mn=1; repeatable"),
    ] = None,
    information: Annotated[
        str, typer.Option(help="data that a method uses: planar, image, moment, force or push")
    ] = "image",
    # Chosen: six columns fit a telephone; deflections from hardly visible to large.
    contact_distances: Annotated[
        str, typer.Option("--contact-distance-pct", help="contact distances [% of L]")
    ] = "15,30,45,60,75,90",
    deflections: Annotated[
        str, typer.Option("--deflection-pct", help="deflections of the tip [% of L]")
    ] = "1,2,5,10,20,30",
    seed: Seed = None,
    settings: Settings = None,
    _module: Modules = None,
    out: Annotated[
        Path | None,
        typer.Option(help="HTML page to write", show_default="runs/limits/SCENE.html"),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file to write, one row per place")] = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Compute information limits: of a scene as maps, without rendering; or of a dataset.

    A limit is the smallest standard deviation that a method without bias can have (Cramer, Rao).
    Those of a dataset or collection are stored in it, for `score` and `report`.
    """
    with importing():
        from solver.instrument.errors import InputError

    if source.is_dir():
        if vary or require or settings or out or csv or seed is not None:
            raise InputError(
                f"{source}: is a dataset, so that only --workers and --variant are allowed"
            )
        frames = store_limits(source, workers, variant)
        sentence = f"limits of {frames} frames, in {source}"
        print_result({"dataset": str(source), "frames": frames}, sentence, as_json)
        return

    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.api.limits import map_limits

    distances = _numbers("--contact-distance-pct", contact_distances)
    tips = _numbers("--deflection-pct", deflections)
    page = out or Path("runs/limits") / f"{source.stem}.html"
    for path in filter(None, (page, csv)):
        prepare_output_path(path, (source,))
    with ExitStack() as shown:
        maps = map_limits(
            source,
            vary=vary or (),
            require=require or (),
            information=information,
            contact_distance_pct=distances,
            deflection_pct=tips,
            seed=seed,
            settings=settings or (),
            workers=workers,
            variant=variant,
            progress=partial(late_bars(shown, ("limits",)), "limits"),
        )
    write(page, maps.page().encode())
    if csv:
        write(csv, maps.table.write_csv().encode())
    if as_json:
        print_result({"scene": str(source), **maps.record(), "page": str(page)}, "", True)
        return
    show_table(f"{maps.title}\nmedian (best–worst) over places", *maps.summary())
    impossible = [f"{one.design}: {one.reason}" for one in maps.designs if one.reason]
    for line in [*maps.facts, *impossible]:
        print_line(line)
    print_result({}, "\n".join([*maps.answers(), f"page: {page}"]), False)


def store_limits(root: Path, workers: int | None, variant: str | None) -> int:
    """Compute and store the limits of a dataset or collection; return their number of frames."""
    with importing():
        from vbaa_bench.api import limits as api

    with progress_bars() as bars:
        return api.store_limits(
            root,
            workers=workers,
            variant=variant,
            on_rig=progress_bar(bars, "rigs", hidden=True),
            progress=progress_bar(bars, "limits"),
        )


def _numbers(name: str, text: str) -> list[float]:
    """Parse numbers that are separated by commas. Raises InputError."""
    from solver.instrument.errors import InputError, quoted

    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"{name} is {quoted(text)}, allowed are numbers such as 10,20") from error
