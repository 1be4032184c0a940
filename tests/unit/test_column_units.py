"""Units along the axes of results."""

from __future__ import annotations

from lagcli.column_units import UNIT_DATASETS, units_along
from lagcli.columns import BY_NAME

UNITS = {"x": "m", "phi": "rad", "x'": "m/s", "Qc.x": "N", "Qc.phi": "N*m", "lambda.rod": "N"}


def along(name: str, **others: tuple[str, ...]) -> list[str | None]:
    return units_along(BY_NAME[name], ("x", "phi"), ("rod", "free"), UNITS, **others)


def test_each_column_has_the_unit_of_its_name() -> None:
    assert along("q") == ["m", "rad"]
    assert along("multipliers")[0] == "N"
    # a name without a unit has none, which is not the unit 1
    assert along("multipliers")[1] is None


def test_terms_of_constraint_forces_have_the_units_of_the_forces() -> None:
    assert along("constraint_force_by") == along("constraint_force")


def test_units_are_those_of_arrays_along_the_same_axis() -> None:
    for dataset in UNIT_DATASETS:
        assert dataset.axis in BY_NAME[dataset.quantity].axes
