"""Names that need each other: in which order, and which go in circles."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping


class Unbuilt(Exception):
    """Something needs the value of a name that has none yet."""

    def __init__(self, name: str):
        super().__init__(name)
        self.name = name


def build_on_demand(
    names: Iterable[str], build: Callable[[str], None], circle: Callable[[list[str]], None]
) -> None:
    """Build names, each after those that turn out to be needed for it.

    Parameters
    ----------
    names : iterable of str
    build : callable
        Builds one name, at once if that is done; raises Unbuilt for another one that it needs.
    circle : callable
        Is told the names of a circle, of which each needs the next one, and the last one the first;
        after it, none of them is unbuilt.
    """
    for start in names:
        stack = [start]  # no recursion: a chain of bodies is thousands of definitions long
        waiting = {start}
        while stack:
            try:
                build(stack[-1])
            except Unbuilt as need:
                if need.name in waiting:
                    circle(stack[stack.index(need.name) :])
                else:
                    stack.append(need.name)
                    waiting.add(need.name)
            else:
                waiting.discard(stack.pop())


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
