"""Tables in Markdown."""

from collections.abc import Collection, Iterable, Sequence


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], texts: Collection[int] = (0,)
) -> str:
    """Format rows of cells below their heads; the columns `texts` are to the left, others right."""
    rule = ["---" if i in texts else "---:" for i in range(len(heads))]
    escaped = ([cell.replace("|", "\\|") for cell in line] for line in (heads, *rows))
    first, *others = (f"| {' | '.join(line)} |" for line in escaped)
    return "\n".join([first, f"| {' | '.join(rule)} |", *others])
