"""What several unit tests share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.fixture
def count_calls(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Counter[str]]:
    """Return a function that counts the calls of (module, name), … from then on, by name."""

    def watched(*functions: tuple[ModuleType, str]) -> Counter[str]:
        counts: Counter[str] = Counter()

        def watch(module: ModuleType, name: str) -> None:
            original = getattr(module, name)

            def called(*args, **kwargs):
                counts[name] += 1
                return original(*args, **kwargs)

            monkeypatch.setattr(module, name, called)

        for module, name in functions:
            watch(module, name)
        return counts

    return watched
