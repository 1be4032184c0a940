"""BLAS runs in one thread wherever lagcli calls it, unless the user has set a number."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier, Thread

import pytest
from threadpoolctl import ThreadpoolController, threadpool_info

import lagcli
from lagcli.simulations.threads import VARIABLES, one_thread

PENDULUM = Path(__file__).parents[3] / "models" / "pendulum_cartesian.yaml"
#: Runs a command, then prints the threads that BLAS has.
COMMAND = """
import sys
from lagcli.cli.app import main
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
from threadpoolctl import ThreadpoolController, threadpool_info
print("threads", {x["num_threads"] for x in threadpool_info() if x["user_api"] == "blas"})
"""


def blas() -> set[int]:
    return {x["num_threads"] for x in threadpool_info() if x["user_api"] == "blas"}


def set_threads(count: int) -> None:
    """Set the threads of BLAS, in a thread that ends: the one that sets them keeps the control."""

    def set_all() -> None:
        for library in ThreadpoolController().select(user_api="blas").lib_controllers:
            library.set_num_threads(count)

    setting = Thread(target=set_all)
    setting.start()
    setting.join()


@pytest.fixture
def free(monkeypatch):
    """Return the threads that BLAS has where the environment sets no number: two."""
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    import scipy.linalg  # noqa: F401 - may load another BLAS library

    set_threads(2)
    if blas() != {2}:
        pytest.skip("BLAS has one thread, or none of the libraries that threadpoolctl knows")
    yield blas()
    set_threads(1)


@pytest.mark.parametrize(
    ("given", "expected"), [({}, "{1}"), ({"OPENBLAS_NUM_THREADS": "2"}, "{2}")]
)
def test_a_command_takes_one_thread_unless_more_are_asked_for(given, expected, tmp_path, free):
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, "simulate", PENDULUM, "--t-end", "0.1"],
        env={**{k: v for k, v in os.environ.items() if k not in VARIABLES}, **given},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    if given and (os.cpu_count() or 1) < 2:
        pytest.skip("one processor")
    assert done.stdout.splitlines()[-1] == f"threads {expected}"


def test_a_run_takes_one_thread(free, monkeypatch):
    from lagcli.engine.integrate import engine
    from lagcli.simulations import simulation

    seen = []
    find_start, integrate = simulation.find_start, engine.integrate

    def watched(function):
        return lambda *args: (seen.append(blas()), function(*args))[1]

    monkeypatch.setattr(simulation, "find_start", watched(find_start))
    monkeypatch.setattr(engine, "integrate", watched(integrate))
    lagcli.simulate(lagcli.load(PENDULUM), t_end=0.5, samples=3)
    assert seen == [{1}, {1}]
    assert blas() == free


def test_a_sweep_takes_one_thread(free, tmp_path, monkeypatch):
    from lagcli.sweeps.rows.group import RowGroup

    seen = []
    run = RowGroup.run
    monkeypatch.setattr(RowGroup, "run", lambda *args: (seen.append(blas()), run(*args)))
    lagcli.sweep(PENDULUM, ["m=1:2:0.5"], tmp_path / "s.h5", jobs=1, t_end=0.1)
    assert seen == [{1}]
    assert blas() == free


def test_a_number_in_the_environment_stays(free, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with one_thread():
        assert blas() == free


@pytest.mark.parametrize("ends", ["first", "second"])
def test_runs_in_threads_that_overlap_leave_no_limit(ends, free):
    first_inside, second_inside, one_outside = Barrier(2), Barrier(2), Barrier(2)
    seen = []

    def first():
        with one_thread():
            seen.append(blas())
            first_inside.wait(10)
            second_inside.wait(10)
            if ends == "second":
                one_outside.wait(10)
        if ends == "first":
            one_outside.wait(10)

    def second():
        first_inside.wait(10)
        with one_thread():
            seen.append(blas())
            second_inside.wait(10)
            if ends == "first":
                one_outside.wait(10)
        if ends == "second":
            one_outside.wait(10)

    with ThreadPoolExecutor(2) as pool:
        for done in [pool.submit(f) for f in (first, second)]:
            done.result(20)
    assert seen == [{1}, {1}]
    assert blas() == free


def test_what_is_inside_does_not_look_for_the_libraries_again(free, monkeypatch) -> None:
    import threadpoolctl

    asked = []
    limits = threadpoolctl.threadpool_limits
    monkeypatch.setattr(
        threadpoolctl, "threadpool_limits", lambda *a: asked.append(a) or limits(*a)
    )
    with one_thread():
        with one_thread():
            assert blas() == {1}
        assert blas() == {1}
    assert blas() == free
    assert len(asked) == 1
    with one_thread():
        assert blas() == {1}
    assert len(asked) == 2
