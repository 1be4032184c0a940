"""Panels of plots: which curves are drawn together."""

import pytest

from lagcli.pictures.curves import Curve
from lagcli.pictures.plots.run_plot import Panel, split_by_scale


def curves(*names, **more):
    return tuple(Curve(name, "q", (0,), "coordinates", "rad", name, **more) for name in names)


def split(panels, **largest):
    return [[c.name for c in panel.curves] for panel in split_by_scale(panels, largest)]


@pytest.mark.parametrize(
    ("largest", "expected"),
    [
        ({"a": 40, "b": 0.3, "c": 35}, [["a", "c"], ["b"]]),
        ({"a": 0.3, "b": 40, "c": 0.1}, [["a", "c"], ["b"]]),
        ({"a": 1, "b": 0.1, "c": 0.01}, [["a", "b"], ["c"]]),
        ({"a": 1, "b": 0, "c": 0.5}, [["a", "b", "c"]]),
        ({"a": 1e6, "b": 1, "c": 0.01}, [["a"], ["b"], ["c"]]),
        # 0 but for errors: drawn as 0
        ({"a": 0.3, "b": 40, "c": 1e-9}, [["a"], ["b", "c"]]),
        ({"a": 0, "b": 0, "c": 0}, [["a", "b", "c"]]),
    ],
)
def test_curves_of_other_scales_have_panels_of_their_own(largest, expected):
    assert split([Panel(curves("a", "b", "c"))], **largest) == expected


def test_what_the_user_joined_stays_together():
    sizes = {"a": 1, "b": 1e-9}
    both = curves("a", "b")
    kept = [Panel(both, joined=True), Panel(both, over=both), Panel(curves("a", "b", log=True))]
    assert split(kept, **sizes) == [["a", "b"]] * 3


def test_families_stay_together():
    names = [f"x{i}" for i in range(20)]
    assert split([Panel(curves(*names))], **{n: 10.0**-i for i, n in enumerate(names)}) == [names]
