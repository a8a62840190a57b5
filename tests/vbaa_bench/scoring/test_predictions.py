"""Reading of predictions: what is refused, and what counts as missing."""

import io
from pathlib import Path
from random import Random

import polars as pl
import pytest

from solver.instrument.errors import LONGEST_SHOWN, InputError
from tests.draws import scene_seed
from tests.vbaa_bench.scoring.worlds import FREE, truth
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.predictions import read_predictions


@pytest.mark.thorough
@pytest.mark.false_alarm(
    1e-9, "binomial, 50 to 150 refusals of 150 at 77 %; the length of a message is bounded"
)
def test_mutated_predictions_are_scored_or_refused(tmp_path: Path) -> None:
    chance, refusals = Random(scene_seed(12)), list[str]()
    odd = (
        '"',
        "\0",
        "\n",
        "\r",
        ",",
        ";",
        "nan",
        "inf",
        "1e400",
        "1_0",
        "x" * 9000,
        "won",
        "\ufeff",
    )
    true = truth({}, {}, FREE)
    text = "frame_id,x_c_mm,x_c_sigma_mm,outcome\nf0,120,1,contact\nf1,120,1,\nf2,,,no contact\n"
    whole = io.BytesIO()
    pl.read_csv(io.StringIO(text)).write_parquet(whole)
    for number in range(150):
        path = tmp_path / ("own.csv" if number % 3 else "own.parquet")
        if path.suffix == ".csv":
            rows = [line.split(",") for line in text.splitlines()]
            for _ in range(chance.randint(1, 2)):
                row = chance.choice(rows)
                at = chance.randrange(len(row))
                row[at] = chance.choice(["", row[at]]) + chance.choice(odd)
            path.write_text("\n".join(map(",".join, rows)), encoding="utf-8")
        else:
            data = bytearray(whole.getvalue())
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            path.write_bytes(data[: chance.choice([len(data), chance.randrange(len(data))])])
        try:
            score_frames(true, read_predictions(path), "own", str(path))
        except InputError as error:
            refusals.append(str(error))
    assert 50 < len(refusals) < 150
    assert max(map(len, refusals)) < 3 * LONGEST_SHOWN


def test_a_parquet_file_on_which_its_reader_panics_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def panics(_data: object) -> pl.DataFrame:
        raise pl.exceptions.PanicException("assertion failed: offset + length <= self.length")

    (tmp_path / "own.parquet").write_bytes(b"damaged")
    monkeypatch.setattr(pl, "read_parquet_schema", panics)
    with pytest.raises(InputError, match=r"own\.parquet: is not a Parquet table \(assert"):
        read_predictions(tmp_path / "own.parquet")


def test_texts_of_a_table_are_short_and_fit_for_a_terminal(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    head = "frame_id,x_c_mm,outcome,message\n"
    path.write_text(f"{head}f0,,invalid,=1+1\nf1,,invalid,\x1b[2Jx\nf2,,invalid,right\n")
    messages = read_predictions(path)["message"].to_list()
    assert messages == ["'=1+1", "\\x1b[2Jx", "right"]
    path.write_text(f"{head}f0,,invalid,{'x' * 10_001}\n")
    with pytest.raises(InputError, match="message has a cell of 10,001 bytes, allowed are 10,000"):
        read_predictions(path)
