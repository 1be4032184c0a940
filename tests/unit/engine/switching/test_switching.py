"""What of a System switches."""

from lagcli.engine.switching.switching import RowMode


def test_rows_slip_either_way() -> None:
    assert [mode for mode in RowMode if mode.slips] == [RowMode.FORWARD, RowMode.BACKWARD]
