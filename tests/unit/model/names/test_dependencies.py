"""The order of names that need each other."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.model.names.dependencies import topological_order


def test_each_comes_after_what_it_needs() -> None:
    order, cycles = topological_order({"a": ["b", "c"], "b": ["c"], "c": ["elsewhere"]})
    assert order == ["c", "b", "a"]
    assert cycles == []


def test_cycles_are_found() -> None:
    _, cycles = topological_order({"a": ["b"], "b": ["c"], "c": ["b"], "d": ["d"]})
    assert cycles == [["b", "c"], ["d"]]


def test_long_chains_need_no_recursion() -> None:
    size = 10_000
    order, cycles = topological_order({str(i): [str(i + 1)] for i in range(size)})
    assert order[0] == str(size - 1)
    assert cycles == []


@settings(deadline=None)
@given(st.dictionaries(st.integers(0, 9), st.lists(st.integers(0, 12), max_size=4), max_size=10))
def test_any_graph(graph: dict[int, list[int]]) -> None:
    needs = {str(k): [str(v) for v in vs] for k, vs in graph.items()}
    order, cycles = topological_order(needs)
    assert sorted(order) == sorted(needs)
    for cycle in cycles:
        for name, following in zip(cycle, [*cycle[1:], cycle[0]], strict=True):
            assert following in needs[name]
    if not cycles:
        place = {name: i for i, name in enumerate(order)}
        for name, others in needs.items():
            assert all(place[o] < place[name] for o in others if o in place)
