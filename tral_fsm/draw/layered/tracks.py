"""Tracks between two layers on which arrows turn, so that no arrow lies on another."""

from __future__ import annotations

from collections.abc import Sequence

Turn = tuple[int, int]
"""Places across at which a link leaves the near layer and meets the far one."""


def tracks(turns: Sequence[Turn]) -> list[int | None]:
    """Track of each link, counted from the near layer; None for a straight link."""
    bent = [i for i, (a, b) in enumerate(turns) if a != b]
    after: dict[int, set[int]] = {i: set() for i in bent}
    for k, i in enumerate(bent):
        for j in bent[k + 1 :]:
            order = _order(turns[i], turns[j])
            if order:
                after[j if order > 0 else i].add(i if order > 0 else j)
    found: dict[int, int] = {}
    waiting = sorted(bent, key=lambda i: turns[i])
    while waiting:
        # In a cycle of orders one order is ignored.
        free = next((i for i in waiting if not after[i] & set(waiting)), None)
        chosen = waiting[0] if free is None else free
        waiting.remove(chosen)
        taken = {found[j] for j in found if _touch(turns[chosen], turns[j])}
        track = 1 + max((found[j] for j in after[chosen] if j in found), default=-1)
        while track in taken:
            track += 1
        found[chosen] = track
    return [found.get(i) for i in range(len(turns))]


def _touch(one: Turn, two: Turn) -> bool:
    return max(min(one), min(two)) <= min(max(one), max(two))


def _order(one: Turn, two: Turn) -> int:
    """+1: the first link turns first, -1: the second does, 0: the order does not matter."""
    if not _touch(one, two):
        return 0
    (a, b), (c, d) = one, two
    if b == c:  # else the end of one would lie on the beginning of the other
        return -1
    if d == a:
        return 1
    # Crossings if the first turns first, and if the second does.
    first = _inside(c, one) + _inside(b, two)
    second = _inside(a, two) + _inside(d, one)
    return (second > first) - (second < first)


def _inside(place: int, turn: Turn) -> bool:
    return min(turn) < place < max(turn)
