"""Unit tests mirror the package: every module of its foundations has its own."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests"
UNIT = TESTS / "unit"
LAGCLI = ROOT / "lagcli"
#: Packages whose modules each have a test module, as the modules beside the packages do.
PACKAGES = ("engine", "settings", "simulations", "trajectory")
MODULES = sorted(
    file
    for file in LAGCLI.rglob("*.py")
    if (file.parent == LAGCLI or file.relative_to(LAGCLI).parts[0] in PACKAGES)
    and not file.stem.startswith("__")
    and re.search(r"^\s*def ", file.read_text(encoding="utf-8"), re.MULTILINE)
)


def names(module: Path) -> set[str]:
    """Return the names that a module's tests may have: its own or, as names of test modules are
    unique, its own after its folder's.
    """
    return {f"test_{module.stem}.py", f"test_{module.parent.name}_{module.stem}.py"}


@pytest.mark.parametrize("module", MODULES, ids=lambda m: str(m.relative_to(LAGCLI)))
def test_every_module_with_functions_is_tested_by_name(module: Path) -> None:
    folder = UNIT / module.parent.relative_to(LAGCLI)
    found = [folder / name for name in names(module) if (folder / name).exists()]
    assert len(found) == 1, f"{folder} has none of {names(module)}, or both"
    # what is imported from it, or of it
    dotted = ".".join(module.relative_to(ROOT).with_suffix("").parts)
    package, _, name = dotted.rpartition(".")
    text = found[0].read_text(encoding="utf-8")
    assert f"from {dotted} import" in text or f"from {package} import {name}" in text, found[0]


def test_every_folder_of_unit_tests_is_a_package() -> None:
    for folder in UNIT.rglob("*"):
        if folder.is_dir() and folder.name != "__pycache__":
            assert (ROOT / "lagcli" / folder.relative_to(UNIT)).is_dir(), folder


def test_no_two_test_modules_have_one_name() -> None:
    """Pytest imports them by these."""
    counts = Counter(file.name for file in TESTS.rglob("test_*.py"))
    assert [name for name, count in counts.items() if count > 1] == []
