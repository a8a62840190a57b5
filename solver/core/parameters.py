"""Names of the parameters of a fit, and the place of each in the vector of all."""

from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Parameters:
    """Blocks of parameters, in their order in a vector (p,): the name and size of each.

    Raises ValueError if a name is repeated.

    >>> at = Parameters((("q", 1), ("widths", 2), ("psi", 1)))
    >>> at["psi"], at.span("widths"), at.indices("widths", "q")
    (3, slice(1, 3, None), [1, 2, 0])
    """

    blocks: tuple[tuple[str, int], ...]

    def __post_init__(self) -> None:
        names = [name for name, _ in self.blocks]
        if len(set(names)) < len(names):
            raise ValueError(f"names of parameters are repeated: {', '.join(names)}")

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, name: str) -> int:
        """Return the index of a parameter, or of the first one of a block."""
        return self._firsts[name]

    def __contains__(self, name: object) -> bool:
        return name in self._firsts

    def span(self, name: str) -> slice:
        """Return the indices of a block."""
        first = self._firsts[name]
        return slice(first, first + dict(self.blocks)[name])

    def indices(self, *names: str) -> list[int]:
        """Return the indices of several blocks, in the order of their names."""
        return [i for name in names for i in range(*self.span(name).indices(len(self)))]

    def followed_by(self, *blocks: tuple[str, int]) -> "Parameters":
        """Return the parameters with more blocks at their end."""
        return Parameters((*self.blocks, *blocks))

    @cached_property
    def _size(self) -> int:
        return sum(size for _, size in self.blocks)

    @cached_property
    def _firsts(self) -> dict[str, int]:
        firsts, first = {}, 0
        for name, size in self.blocks:
            firsts[name] = first
            first += size
        return firsts
