"""The core stays within its memory, whatever the model is that it is given."""

from __future__ import annotations

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from core_runs import data_of
from random_cases import FUZZ_COUNT

from lagcli.engine.core.fingerprint import CORE, c_files

MUTANTS = Path(__file__).parents[1] / "unit" / "engine" / "core" / "mutants.c"
FLAGS = ["-O1", "-g", "-Wno-psabi", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

pytestmark = pytest.mark.fuzz


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program that runs mutants, with the sanitizers of addresses and undefined behaviour."""
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("neither gcc nor clang, which have sanitizers")
    folder = tmp_path_factory.mktemp("mutants")
    objects = [folder / f"{i}.o" for i in range(1 + len(c_files()))]

    def compiled(source: str | Path, made: Path) -> None:
        command = [compiler, *FLAGS, f"-I{CORE}", "-c", str(source), "-o", str(made)]
        subprocess.run(command, check=True)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(compiled, [MUTANTS, *c_files()], objects))
    made = folder / "mutants"
    done = subprocess.run(
        [compiler, *FLAGS, *objects, "-lm", "-o", made], capture_output=True, text=True
    )
    if done.returncode and "san" in done.stderr:
        pytest.skip("the compiler has no sanitizers")
    assert done.returncode == 0, done.stderr
    return made


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("pendulum_cartesian", "DOP853"),
        ("parallelogram", "Radau"),
        ("car_on_road", "Taylor"),
        ("chain", "Taylor"),
        ("contact/bouncing_ball", "DOP853"),
        ("contact/rocking_block", "DOP853"),
        ("contact/woodpecker", "Taylor"),
        ("contact/stick_slip_belt", "DOP853"),
        ("contact/slider_crank_friction", "Radau"),
        ("contact/clutch", "Rodas5P"),
        ("contact/sampled_pendulum", "DOP853"),
        ("contact/particle_on_sphere", "Taylor"),
    ],
)
def test_damaged_models_end_with_a_status(
    name: str, method: str, program: Path, tmp_path: Path
) -> None:
    file = tmp_path / "model"
    file.write_bytes(data_of(name, (method,)))
    command = [program, file, method, str(FUZZ_COUNT), "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    accepted, *rejected = map(int, done.stdout.split())
    assert accepted + sum(rejected) == FUZZ_COUNT
    # enough of both, so that the checks and the runs have been tried; some checks reject one
    # mutant of 300, others one of five
    assert accepted > FUZZ_COUNT / 20
    assert sum(1 for count in rejected if count) >= (5 if FUZZ_COUNT >= 1000 else 2)
