"""Runs that do not fit into the memory say so before they start, and never as a bug."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from trajectories import environment

import lagcli
from lagcli.errors import NumericalError
from lagcli.simulations import memory

MODEL = Path(__file__).parents[3] / "models" / "slider_crank.yaml"
pytest.importorskip("resource", reason="limits of memory are those of POSIX")


def test_a_run_that_does_not_fit_is_rejected_before_it_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(memory, "available", lambda: 100_000_000)
    steps: list[float] = []
    with pytest.raises(
        NumericalError, match=r"1000000 samples needs about .* MB of memory, and 100"
    ):
        lagcli.simulate(lagcli.load(MODEL), samples=1_000_000, progress=steps.append)
    assert not steps
    run = lagcli.simulate(lagcli.load(MODEL), samples=11, t_end=0.1)
    assert np.isfinite(run.q).all()


def test_a_plot_that_does_not_fit_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without enough memory, matplotlib would end the process."""
    run = lagcli.simulate(lagcli.load(MODEL), samples=11, t_end=0.1)
    monkeypatch.setattr(memory, "available", lambda: 10_000_000)
    with pytest.raises(NumericalError, match="drawing a plot needs about"):
        lagcli.plot(run, output=tmp_path / "run.png")
    assert not list(tmp_path.iterdir())


def test_the_limits_of_the_system_are_known() -> None:
    free = memory.available()
    if sys.platform == "linux":
        assert free is not None
    assert free is None or free > 1_000_000


@pytest.mark.skipif(sys.platform != "linux", reason="address space is limited so on Linux alone")
@pytest.mark.parametrize(
    ("megabytes", "arguments", "said"),
    [
        (600, ("simulate", str(MODEL), "--samples", "100000000"), "samples needs about"),
        (150, ("info", "run.h5"), "ulimit -v"),
        # without these, OpenBLAS ends the process with status 1, or never returns
        (235, ("simulate", str(MODEL), "--t-end", "0.1"), "ulimit -v"),
        (280, ("modes", str(MODEL)), "loading scipy needs about"),
        (350, ("compare", str(MODEL), "--t-end", "0.1"), "loading scipy needs about"),
        (235, ("plot", "run.h5", "-o", "run.png"), "ulimit -v"),
    ],
)
def test_too_little_memory_is_a_message(
    tmp_path: Path, megabytes: int, arguments: tuple[str, ...], said: str
) -> None:
    lagcli.write(lagcli.simulate(lagcli.load(MODEL), samples=11, t_end=0.1), tmp_path / "run.h5")
    code = (
        f"import resource, sys; resource.setrlimit(resource.RLIMIT_AS, ({megabytes}000000,) * 2);"
        "from lagcli.cli.app import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=environment() | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        cwd=tmp_path,
    )
    assert done.returncode == 3, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="address space is limited so on Linux alone")
def test_blas_has_its_buffer_before_a_model_takes_the_rest() -> None:
    """A chain of 1100 masses left OpenBLAS too little under a limit of 268 MB: it ended."""
    code = """
import re, resource
resource.setrlimit(resource.RLIMIT_AS, (600_000_000,) * 2)
from lagcli.simulations.memory import check_address_space
check_address_space()
import numpy as np
size = lambda: int(re.search(r"VmSize:\\s+(\\d+)", open("/proc/self/status").read())[1])
square = np.ones((300, 300))
before = size()
square @ square
print(size() - before)
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment() | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) < 10_000  # kB; the buffer has 33,000
