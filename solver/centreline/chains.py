"""Candidates of neighbouring scan lines, linked into chains, and chains into long thin lines."""

from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from solver.centreline.candidates import candidates
from solver.centreline.noise import Noise
from solver.instrument.arrays import Floats, Grey

# A chain may miss so many scan lines.
GAP = 4
# Its newest points tell where it goes on, to about so many pixels; a young one climbs no more
# than the diagonal, and no chain by more pixels a scan line: the other scan lines cross it better.
RECENT, TOLERANCE_PX, STEEPEST = 12, 1.0, 1.2
# Shorter chains are noise.
LEAST_POINTS = 12
# A line goes on beyond a gap of at most this share of its own length, where a chain begins whose
# direction differs by no more than this [rad] and which lies off its straight course by no more.
WIDEST_GAP, LARGEST_TURN = 0.3, 0.25


@dataclass
class _Chain:
    """A chain that is growing, along one axis; places are (line, place)."""

    places: list[tuple[float, float]] = field(default_factory=list)

    def expected(self, line: float) -> tuple[float, float]:
        """Where the chain should cross a scan line, and how far off it may be."""
        recent = self.places[-RECENT:]
        last = recent[-1]
        n = len(recent)
        if n < RECENT // 2:
            return last[1], TOLERANCE_PX * (line - last[0])
        # The straight line through the newest points; Python is faster than numpy over twelve.
        x, y = sum(p[0] for p in recent) / n, sum(p[1] for p in recent) / n
        slope = sum((p[0] - x) * p[1] for p in recent) / sum((p[0] - x) ** 2 for p in recent)
        return y + slope * (line - x), TOLERANCE_PX if abs(slope) < STEEPEST else 0.0


def long_lines(image: Grey, core: int, polarity: int, noise: Noise, least: float) -> list[Floats]:
    """Lines of at least `least` pixels, each (n, 2) as (u, v) from one end to the other.

    `core` [px] is about their width, `polarity` 1 for bright ones and -1 for dark ones.
    """
    chains: list[Floats] = []
    for upright in (True, False):
        lines = np.arange(image.shape[1] if upright else image.shape[0])
        linked = _linked(candidates(image, lines, upright, core, polarity, noise))
        chains += linked if upright else [places[:, ::-1] for places in linked]
    chains.sort(key=_extent, reverse=True)
    found: list[Floats] = []
    for chain in chains:
        if _extent(chain) < least:
            break
        if not any(_shared(chain, line) > 0.5 for line in found):
            found.append(_prolonged(chain, chains))
    return found


def _linked(seen: Floats) -> list[Floats]:
    """Chains (n, 2) of candidates, as (scan line, place in it)."""
    growing: list[_Chain] = []
    done: list[_Chain] = []
    for line, group in groupby(seen, key=lambda row: float(row[0])):
        places = [float(row[1]) for row in group]
        done += [chain for chain in growing if line - chain.places[-1][0] > GAP]
        growing = [chain for chain in growing if line - chain.places[-1][0] <= GAP]
        expected = [chain.expected(line) for chain in growing]
        pairs = sorted(
            (abs(place - at), i, k)
            for i, (at, tolerance) in enumerate(expected)
            for k, place in enumerate(places)
            if abs(place - at) <= tolerance
        )
        continued: set[int] = set()
        taken: set[int] = set()
        for _, i, k in pairs:
            if i not in continued and k not in taken:
                growing[i].places.append((line, places[k]))
                continued.add(i)
                taken.add(k)
        growing += [_Chain([(line, p)]) for k, p in enumerate(places) if k not in taken]
    return [np.array(c.places) for c in done + growing if len(c.places) >= LEAST_POINTS]


def _extent(chain: Floats) -> float:
    return float(np.hypot(*(chain[-1] - chain[0])))


def _shared(chain: Floats, line: Floats) -> float:
    """Share of a chain's points that lie on a line."""
    apart = np.hypot(*(chain[:, None] - line[None]).transpose(2, 0, 1)).min(axis=1)
    return float(np.mean(apart < 2.0))


def _prolonged(line: Floats, chains: list[Floats]) -> Floats:
    """The line, and at either end the chains that go on with it."""
    for _ in range(2):
        while True:
            following = [
                (gap, number)
                for number, chain in enumerate(chains)
                if (gap := _gap(line, chain)) is not None
            ]
            if not following:
                break
            _, number = min(following)
            line = np.vstack([line, _ahead(line, chains[number])])
        line = line[::-1]
    return line


def _direction(line: Floats) -> Floats:
    """Unit vector (2,) in which a line ends."""
    recent = line[-RECENT:]
    step = recent[len(recent) // 2 :].mean(axis=0) - recent[: len(recent) // 2].mean(axis=0)
    return np.asarray(step / np.hypot(*step))


def _ahead(line: Floats, chain: Floats) -> Floats:
    """What of the chain lies beyond the line's end, in the sense in which it leads away from it."""
    away = np.hypot(*(chain[[0, -1]] - line[-1]).T)
    chain = chain if away[0] <= away[1] else chain[::-1]
    behind = np.flatnonzero((chain - line[-1]) @ _direction(line) <= 0)
    return chain[behind[-1] + 1 :] if len(behind) else chain


def _gap(line: Floats, chain: Floats) -> float | None:
    """How far beyond the line's end a chain begins that goes on with it; None if it does not."""
    chain = _ahead(line, chain)
    if len(chain) < LEAST_POINTS:
        return None
    off, towards = chain[0] - line[-1], _direction(line)
    gap, across = off @ towards, abs(off[0] * towards[1] - off[1] * towards[0])
    turn = np.arccos(np.clip(towards @ _direction(chain[:RECENT]), -1, 1))
    if (
        gap > WIDEST_GAP * _extent(line)
        or across > 2 * TOLERANCE_PX + LARGEST_TURN * gap
        or turn > LARGEST_TURN
    ):
        return None
    return float(gap)
