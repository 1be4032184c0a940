"""Names that need each other: in which order, and which go in circles."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping


def in_order(needs: Mapping[str, Collection[str]]) -> tuple[list[str], list[list[str]]]:
    """Sort names so that each comes after those that it needs.

    Parameters
    ----------
    needs : mapping of str to collections of str
        What each name needs; what is no key of the mapping is left alone.

    Returns
    -------
    order : list of str
        All names; those of a circle in any order.
    circles : list of lists of str
        Each name of a circle needs the next one, and the last one the first.
    """
    order: dict[str, None] = {}
    circles: list[list[str]] = []
    for start in needs:
        if start in order:
            continue
        # no recursion: a chain of bodies is thousands of definitions long
        path: dict[str, Iterator[str]] = {start: iter(needs[start])}
        while path:
            name = next(reversed(path))
            for other in path[name]:
                if other in path:
                    names = list(path)
                    circles.append(names[names.index(other) :])
                elif other in needs and other not in order:
                    path[other] = iter(needs[other])
                    break
            else:
                del path[name]
                order[name] = None
    return list(order), circles
