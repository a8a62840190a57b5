"""Outcomes claimed by methods against what was true, with equal rows joined."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import polars as pl

from solver.instrument.estimate import Outcome
from vbaa_bench.scoring.statistics import CONTACTS

_MAX_MESSAGES: Final = 40


class OutcomeRow(NamedTuple):
    """Methods with the same counts of frames, one for each of `OutcomeTable.columns`."""

    methods: Sequence[str]
    counts: Sequence[int]


class OutcomeTable(NamedTuple):
    """Counts of frames; `columns` are truth, claim and verdict ("right" or "wrong").

    `trivial` are methods that only had contacts and estimated all of them; they have no row.
    """

    columns: Sequence[tuple[str, str, str]]
    rows: Sequence[OutcomeRow]
    trivial: Sequence[str]


def outcomes(rows: pl.DataFrame, methods: Sequence[str]) -> OutcomeTable:
    """Count frames by truth, claimed outcome and verdict."""
    answered = pl.col("outcome").is_in(CONTACTS) & ~pl.col("failed")
    labelled = rows.select(
        "method",
        pl.when("free").then(pl.lit("no contact")).otherwise(pl.lit("contact")).alias("truth"),
        # An outcome with values of which a required one is missing.
        pl.when(pl.col("outcome").is_in(CONTACTS) & pl.col("failed") & ~pl.col("free"))
        .then(pl.lit("incomplete"))
        .otherwise("outcome")
        .alias("claim"),
        pl.when(pl.col("rightly_refused") | answered | (pl.col("free") & ~pl.col("failed")))
        .then(pl.lit("right"))
        .otherwise(pl.lit("wrong"))
        .alias("verdict"),
    )
    counts = labelled.group_by("method", "truth", "claim", "verdict").len()
    table = {
        (row["method"], (row["truth"], row["claim"], row["verdict"])): row["len"]
        for row in counts.to_dicts()
    }
    usual = ("contact", str(Outcome.CONTACT), "right")
    columns = sorted({column for _, column in table}, key=lambda one: (one != usual, one))
    present = [name for name in methods if any(method == name for method, _ in table)]
    vectors = {name: tuple(table.get((name, c), 0) for c in columns) for name in present}
    trivial = [
        name for name in present if (name, usual) in table and sum(map(bool, vectors[name])) == 1
    ]
    joined = [
        OutcomeRow([name for name in present if vectors[name] == counts], counts)
        for counts in dict.fromkeys(vectors[name] for name in present if name not in trivial)
    ]
    used = [i for i in range(len(columns)) if any(row.counts[i] for row in joined)]
    return OutcomeTable(
        [columns[i] for i in used],
        [OutcomeRow(row.methods, [row.counts[i] for i in used]) for row in joined],
        trivial,
    )


def messages(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """Count failures by outcome and message, numbers in messages left out; the commonest first."""
    failed = rows.filter("failed").with_columns(
        pl.col("message").fill_null("").str.replace_all(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "…")
    )
    groups = failed.group_by("outcome", "message", "rightly_refused", maintain_order=True).agg(
        frames=pl.len(), methods=pl.col("method").unique(maintain_order=True)
    )
    order = ["frames", "outcome", "message"]
    return groups.sort(order, descending=[True, False, False]).head(_MAX_MESSAGES).to_dicts()
