"""The record of settings that the core uses."""

from __future__ import annotations

import math

import pytest

from lagcli.engine.core.headers import headers
from lagcli.engine.core.settings import CORE_SETTINGS, c_type, core_values
from lagcli.engine.core.structures import lag_settings
from lagcli.settings.kinds import Choice, Flag, RealNumber, Times, WholeNumber
from lagcli.settings.settings import SettingsOverrides, resolve


def test_the_record_has_the_values_of_a_run() -> None:
    settings = resolve(
        SettingsOverrides(t_end=2.0, rtol=1e-6, max_step=0.5, max_steps=7, closed=1e-8),
        SettingsOverrides(formulation="baumgarte", beta=3.0, impacts="newton"),
    )
    values = core_values(settings)
    assert math.isnan(values.pop("alpha"))
    assert values == {
        "t_end": 2.0,
        "rtol": 1e-6,
        "formulation": 1,
        "beta": 3.0,
        "max_step": 0.5,
        "max_steps": 7,
        "impacts": 1,
        "closed": 1e-8,
    }
    record = lag_settings(**core_values(settings))
    assert (record.max_step, record.max_steps, record.impacts) == (0.5, 7, 1)
    assert core_values(resolve(SettingsOverrides()))["max_step"] == math.inf


def test_every_kind_has_a_type_in_c() -> None:
    kinds = {RealNumber: "double", WholeNumber: "int64_t", Choice: "int", Flag: "int"}
    assert {kind: c_type(kind("")) for kind in kinds} == kinds
    with pytest.raises(AssertionError):
        c_type(Times(""))


def test_the_header_lists_the_settings() -> None:
    text = headers()["settings.h"]
    for name, setting in CORE_SETTINGS.items():
        assert f"    {c_type(setting)} {name}; /* {setting.help} */\n" in text
    assert "enum lag_impacts { LAG_POISSON, LAG_NEWTON, LAG_SEQUENTIAL };\n" in text
    assert "    CHOICE(formulation, 3)" in text
    assert "    COUNT(max_steps)" in text
    assert "    REAL(max_step)" in text
