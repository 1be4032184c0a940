"""Where it was measured: processor, cores, versions."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = (
    *("lagcli", "numpy", "scipy", "sympy", "symengine", "numba"),
    *("casadi", "scikit-sundae", "heyoka", "exudyn", "pydy"),
)


def processor() -> str:
    """Return the processor's name and the number of its cores that there are to use."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    name = names[0] if names else platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores"


def system() -> str:
    """Return the operating system and Python's version."""
    return f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"


def load() -> float:
    """Return the number of processes that wanted to run in the last minute, on average."""
    return os.getloadavg()[0]


def installed(package: str) -> str | None:
    """Return the version of a package, or None."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def versions() -> dict[str, str | None]:
    """Return the versions of all that takes part; None where it is not installed."""
    return {name: installed(name) for name in PACKAGES}


def revision() -> str:
    """Return the commit that is measured; empty where there is no repository."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()
