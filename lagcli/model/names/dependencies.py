"""Dependencies between names: evaluation order and cycles."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping


class Unbuilt(Exception):
    """The value of a name is needed before it has been built."""

    def __init__(self, name: str):
        super().__init__(name)
        self.name = name


def build_on_demand(
    names: Iterable[str], build: Callable[[str], None], cycle: Callable[[list[str]], None]
) -> None:
    """Build names in the order of their dependencies, which are discovered while building.

    Parameters
    ----------
    names : iterable of str
    build : callable
        Builds one name; raises Unbuilt if another name must be built first.
    cycle : callable
        Called with the names of a cycle, each depending on the next, the last on the first.
        Afterwards none of them may raise Unbuilt.
    """
    for start in names:
        stack = [start]  # iterative: a chain of bodies has thousands of definitions
        waiting = {start}
        while stack:
            try:
                build(stack[-1])
            except Unbuilt as need:
                if need.name in waiting:
                    cycle(stack[stack.index(need.name) :])
                else:
                    stack.append(need.name)
                    waiting.add(need.name)
            else:
                waiting.discard(stack.pop())


def topological_order(needs: Mapping[str, Collection[str]]) -> tuple[list[str], list[list[str]]]:
    """Sort names topologically: each after the names that it depends on.

    Parameters
    ----------
    needs : mapping of str to collections of str
        Dependencies of each name; names that are not keys are ignored.

    Returns
    -------
    order : list of str
        All names; members of a cycle in any order.
    cycles : list of lists of str
        Each name of a cycle depends on the next, the last on the first.
    """
    order: dict[str, None] = {}
    cycles: list[list[str]] = []
    for start in needs:
        if start in order:
            continue
        # iterative: a chain of bodies has thousands of definitions
        path: dict[str, Iterator[str]] = {start: iter(needs[start])}
        while path:
            name = next(reversed(path))
            for other in path[name]:
                if other in path:
                    names = list(path)
                    cycles.append(names[names.index(other) :])
                elif other in needs and other not in order:
                    path[other] = iter(needs[other])
                    break
            else:
                del path[name]
                order[name] = None
    return list(order), cycles
