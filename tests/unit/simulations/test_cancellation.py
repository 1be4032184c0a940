"""Signals that are noted, and those that are not."""

from __future__ import annotations

import signal
import threading

import pytest

from lagcli.simulations.cancellation import Interruption


def test_a_signal_is_noted_once_somebody_asks() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interruption() as interruption:
        assert not interruption.requested()
        signal.raise_signal(signal.SIGINT)
        assert interruption.requested()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_signal_before_is_as_usual() -> None:
    with Interruption(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_only_the_named_signals_are_noted() -> None:
    with Interruption(signal.SIGTERM) as interruption:
        assert not interruption.requested()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert not interruption.requested()
        signal.raise_signal(signal.SIGTERM)
        assert interruption.requested()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


@pytest.mark.parametrize("handler", [signal.SIG_IGN, lambda number, frame: None])
def test_what_the_program_around_does_with_a_signal_stays(handler: object) -> None:
    before = signal.signal(signal.SIGINT, handler)  # type: ignore[arg-type]
    try:
        with Interruption() as interruption:
            assert signal.getsignal(signal.SIGINT) is handler
            assert not interruption.requested()
            signal.raise_signal(signal.SIGINT)
            assert not interruption.requested()
    finally:
        signal.signal(signal.SIGINT, before)


def test_another_thread_may_enter_it() -> None:
    found: list[bool] = []

    def enter() -> None:
        with Interruption() as interruption:
            found.append(interruption.requested())

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    assert found == [False]
