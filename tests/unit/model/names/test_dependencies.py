"""The order of names that need each other."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lagcli.model.names.dependencies import in_order


def test_each_comes_after_what_it_needs() -> None:
    order, circles = in_order({"a": ["b", "c"], "b": ["c"], "c": ["elsewhere"]})
    assert order == ["c", "b", "a"]
    assert circles == []


def test_circles_are_found() -> None:
    _, circles = in_order({"a": ["b"], "b": ["c"], "c": ["b"], "d": ["d"]})
    assert circles == [["b", "c"], ["d"]]


def test_long_chains_need_no_recursion() -> None:
    size = 10_000
    order, circles = in_order({str(i): [str(i + 1)] for i in range(size)})
    assert order[0] == str(size - 1)
    assert circles == []


@given(st.dictionaries(st.integers(0, 9), st.lists(st.integers(0, 12), max_size=4), max_size=10))
def test_any_graph(graph: dict[int, list[int]]) -> None:
    needs = {str(k): [str(v) for v in vs] for k, vs in graph.items()}
    order, circles = in_order(needs)
    assert sorted(order) == sorted(needs)
    for circle in circles:
        for name, following in zip(circle, [*circle[1:], circle[0]], strict=True):
            assert following in needs[name]
    if not circles:
        place = {name: i for i, name in enumerate(order)}
        for name, others in needs.items():
            assert all(place[o] < place[name] for o in others if o in place)
