"""What lines about contacts say, and how their rows act."""

import pytest

from lagcli.analysis.local.contacts import (
    Acting,
    ContactState,
    ContactStatus,
    acting,
    contact_lines,
    describe_contacts,
)


@pytest.mark.parametrize(
    ("contact", "text"),
    [
        (ContactStatus("floor", "open", 0.25, 0.0, None), "floor open (gap 0.25)"),
        (ContactStatus("floor", "touches", 0.0, 0.0, None), "floor touches"),
        (ContactStatus("floor", "closed", 0.0, 19.62, None), "floor closed (λ = 19.62)"),
        (ContactStatus("wheel", "sticks", None, 1.5, 6.0), "wheel sticks (λ = 1.5, limit 6)"),
        (ContactStatus("wheel", "slips", None, -6.0, 6.0), "wheel slips (λ = -6)"),
        (ContactStatus("clutch", "released", None, 0.0, None), "clutch released"),
    ],
)
def test_lines(contact: ContactStatus, text: str) -> None:
    (line,) = contact_lines(describe_contacts([contact]), 2)
    assert line.split(None, 1) == ["contacts", text]


def test_no_contacts_no_lines() -> None:
    assert contact_lines([], 2) == []


@pytest.mark.parametrize(
    ("state", "multiplier", "expected"),
    [
        ("open", 0.0, Acting.OPEN),
        ("touches", 0.0, Acting.OPEN),
        ("closed", 2.0, Acting.HOLDS),
        ("holds", 2.0, Acting.HOLDS),
        # friction opposes the velocity
        ("slips", -2.0, Acting.FORWARD),
        ("slips", 2.0, Acting.BACKWARD),
    ],
)
def test_rows_act(state: ContactState, multiplier: float, expected: Acting) -> None:
    (contact,) = describe_contacts([ContactStatus("c", state, None, multiplier, None)])
    assert acting(contact) == expected
