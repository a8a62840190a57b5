"""Tables of the trials: by kind of file and of damage, and by command."""

from collections.abc import Sequence
from typing import Any, Final

from tests.robustness.damage.readers import READERS
from tests.robustness.damage.trials import CRASHED, OUTCOMES, SILENT, Trial
from vbaa_bench.scoring.tables import markdown_table

Row = dict[str, Any]

_HEADS: Final = ("kind of file", "damage", "trials", "named by verify", "used silently", "crashed")


def rows(trials: Sequence[Trial]) -> list[Row]:
    """Count the trials of each kind of file and damage."""
    table = []
    for kind, damage in sorted({(trial.kind, trial.damage) for trial in trials}):
        chosen = [trial for trial in trials if (trial.kind, trial.damage) == (kind, damage)]
        outcomes = [list(trial.outcomes.values()) for trial in chosen]
        values = (
            kind,
            damage,
            len(chosen),
            sum(trial.named for trial in chosen),
            sum(SILENT in values for values in outcomes),
            sum(CRASHED in values for values in outcomes),
        )
        table.append(dict(zip(_HEADS, values, strict=True)))
    return table


def command_rows(trials: Sequence[Trial]) -> list[Row]:
    """Count the outcomes of each command."""
    return [
        {
            "command": command,
            **{
                outcome: sum(trial.outcomes[command] == outcome for trial in trials)
                for outcome in OUTCOMES
            },
        }
        for command in READERS
    ]


def passed(trials: Sequence[Trial]) -> bool:
    """Test whether every damage was named, and no command used one silently or crashed."""
    return all(
        trial.named and not {SILENT, CRASHED} & set(trial.outcomes.values()) for trial in trials
    )


def markdown(trials: Sequence[Trial], command: str) -> str:
    """Write the results as a page."""
    named = sum(trial.named for trial in trials)
    silent = sum(SILENT in trial.outcomes.values() for trial in trials)
    crashed = sum(CRASHED in trial.outcomes.values() for trial in trials)
    return "\n".join(
        [
            "# Damaged files",
            "",
            f"`{command}`",
            "",
            f"{len(trials)} files of a finished dataset were damaged, one at a time: a byte was "
            "changed, the file was cut, removed, or given another name in its folder. Kinds of "
            "files and damages take turns; the file and the place in it are random.",
            "",
            "| asked | measured |",
            "|---|---|",
            f"| `verify` names every damaged file | {named} of {len(trials)} |",
            f"| no command uses a damaged file silently | {silent} of {len(trials)} trials |",
            f"| no command ends with another error than one sentence | {crashed} of {len(trials)} "
            "trials |",
            "",
            "A command passes if it refuses the dataset with a sentence, or if its results are "
            "byte for byte those of the intact dataset. `solve` is the copy of the observations "
            "that a method receives.",
            "",
            _table(command_rows(trials)),
            "",
            _table(rows(trials)),
            "",
        ]
    )


def _table(table: Sequence[Row]) -> str:
    heads = list(table[0])
    texts = [i for i, head in enumerate(heads) if isinstance(table[0][head], str)]
    return markdown_table(heads, ([str(row[head]) for head in heads] for row in table), texts)
