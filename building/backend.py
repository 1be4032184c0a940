"""The build backend (PEP 517): that of setuptools, which asks for Zig where no C compiler works."""

from __future__ import annotations

from typing import Any

from core_library import ZIG, needs_zig
from setuptools import build_meta
from setuptools.build_meta import (  # noqa: F401  (the hooks of setuptools)
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)


def _compiler() -> list[str]:
    return [ZIG] if needs_zig() else []


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return what a wheel is built with."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_compiler()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return what an editable installation is built with."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *_compiler()]
