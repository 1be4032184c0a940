"""Files with a right checksum and wrong contents: read, or rejected, never with a traceback.

A mutant has changed attributes or arrays, and a new checksum, as another program would write it.
"""

from __future__ import annotations

import contextlib
import json
import random
import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from answers import answer
from mutants import changed_content
from random_cases import FUZZ_COUNT, some

import lagcli
from lagcli.errors import LagcliError
from lagcli.results.hdf5 import seal

#: Mutants of each file in the normal suite, always the same ones; `make fuzz` tries more.
FEW = 1

SPRING = """
name: spring
coordinates: {x: m}
parameters: {m: 1 kg, k: {value: 10, unit: N/m}, c: 0.1}
T: m*x'^2/2
V: k*x^2/2
Q: {x: -c*x'}
initial: {x: 10 cm, x': 0}
fit:
  data: [{file: run.csv}, {file: run.csv}]
  observe: {x: {column: x, sigma: 0.1}}
  parameters: {k: {min: 1}, c: {min: 0}, x: }
"""

#: How each file is made: the arguments of the command, before ``-o``.
FILES = {
    "run": ["simulate", "slider_crank", "--t-end", "0.5", "--samples", "21"],
    "bounces": ["simulate", "bouncing_ball", "--samples", "31", "--sensitivity", "g,e"],
    "road": ["simulate", "car_on_road", "--t-end", "0.2", "--samples", "9"],
    "sweep": [
        *("sweep", "slider_crank", "--vary", "l=0.2,0.3", "--vary", "m=1,2", "--t-end", "0.1"),
        *("--samples", "5", "--jobs", "1", "--measure", "peak=max(phi)", "--keep", "trajectories"),
    ],
    "drawn": [
        *("sweep", "slider_crank", "--vary", "l=0.2..0.3", "--vary", "m=1..2"),
        *("--sample", "sobol:4", "--measure", "peak=max(phi)", "--t-end", "0.1", "--jobs", "1"),
    ],
    "modes": ["modes", "chain", "--set", "N=3"],
    "rolling": ["modes", "slider_crank"],
    "linear": ["linearize", "slider_crank"],
    "equilibria": ["equilibrium", "slider_crank", "--all", "--starts", "8"],
    "resting": ["equilibrium", "bouncing_ball"],
    "branches": [
        *("equilibrium", "bead_on_rotating_hoop", "--along", "Omega=1 rad/s:6 rad/s"),
        "--branches",
    ],
    "formulations": ["compare", "slider_crank", "--t-end", "0.1"],
    "models": ["compare", "slider_crank", "slider_crank", "--t-end", "0.1"],
    "fit": ["fit", "spring.yaml", "--starts", "2"],
}


def commands(kind: str, folder: Path) -> list[list[str]]:
    """Return the commands that read files of a kind, with ``FILE`` for the file."""
    page, picture, table = (str(folder / f"out.{x}") for x in ("html", "svg", "csv"))
    found = [
        ["info", "FILE"],
        ["info", "FILE", "--json"],
        ["report", "FILE", "-o", page, "--force", "--quiet"],
    ]
    if kind not in ("linear", "equilibria", "resting"):
        found.append(["plot", "FILE", "-o", picture, "--force"])
    if kind in ("modes", "rolling"):
        found.append(["animate", "FILE", "--mode", "1", "-o", page, "--force", "--quiet"])
    if kind in ("run", "bounces", "road"):
        found.append(["animate", "FILE", "-o", page, "--force", "--quiet"])
    if kind == "bounces":
        found.append(["plot", "FILE", "y", "--band", "g=1%", "-o", picture, "--force"])
    if kind in ("sweep", "drawn"):
        found.append(["export-csv", "FILE", "-o", table, "--force"])
        found.append(["plot", "FILE", "tornado:peak", "-o", picture, "--force"])
        found.append([*FILES[kind], "-o", "FILE", "--resume", "--quiet"])
    return found


class Originals(dict[str, bytes]):
    """A file of each kind, made when it is first read: `--dist worksteal` divides the tests."""

    def __init__(self, folder: Path):
        super().__init__()
        self.folder = folder

    def __missing__(self, kind: str) -> bytes:
        with contextlib.chdir(self.folder):
            if kind == "fit":
                Path("spring.yaml").write_text(SPRING, encoding="utf-8")
                self.make("simulate", "spring.yaml", "-o", "run.csv", "--t-end", "1")
            self.make(*FILES[kind], "-o", f"{kind}.h5")
            self[kind] = Path(f"{kind}.h5").read_bytes()
        return self[kind]

    def make(self, *arguments: str) -> None:
        status, said = answer(*arguments)
        assert status == 0, (arguments, said)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> Originals:
    """Return the files that are changed."""
    return Originals(tmp_path_factory.mktemp("originals"))


@contextlib.contextmanager
def changed(path: Path, original: bytes) -> Iterator[h5py.File]:
    """Write a file whose content is changed in this context, with a checksum of its own."""
    path.write_bytes(original)
    with h5py.File(path, "a") as root:
        yield root
    with path.open("r+b") as file:
        seal.seal(file)


def try_mutants(kind: str, original: bytes, folder: Path, count: int) -> Counter[str]:
    """Read mutants of a file by all commands that read such files."""
    path, r = folder / f"{kind}.h5", random.Random(kind)
    # what a picture or a run of the model needs may be missing in a mutant: status 2 or 3
    readers = [[str(path) if x == "FILE" else x for x in c] for c in commands(kind, folder)]
    path.write_bytes(original)
    for arguments in readers:
        status, said = answer(*arguments)
        assert status == 0, (arguments, said)
    counts: Counter[str] = Counter()
    while counts["mutants"] < count:
        path.write_bytes(original)
        if not (place := changed_content(path, r)):
            continue
        with path.open("r+b") as file:
            seal.seal(file)
        counts["mutants"] += 1
        for arguments in (readers[0], r.choice(readers[1:])):
            status, said = answer(*arguments)
            allowed = (0, 4) if arguments[0] == "info" else (0, 2, 3, 4)
            wrong = status not in allowed or "Traceback" in said or "Warning" in said
            if status == 4 and "--resume" not in arguments:
                wrong = wrong or path.name not in said
            if wrong:
                kept = folder / f"mutant_{counts['mutants']}_{path.name}"
                shutil.copy(path, kept)
                raise AssertionError(f"{place}: {arguments}: status {status}: {said} ({kept})")
            counts[f"status {status}"] += 1
        if r.random() < 0.1:
            with contextlib.suppress(LagcliError):
                lagcli.open(path)
    return counts


#: Files that ended with tracebacks, and what `info` and `report` say.
FOUND = {
    "mut_cmp_5_1": "content.runs: 1e+300 is not of type 'array'",
    "mut_eq_5_2": "content.branches[0]: 'stability' is a required property",
    "mut_eq_5_3": "content.",
    "mut_fit_2_19": "correlation has shape",
    "mut_fit_5_7": "parameters.c: [[[]]] is not of type 'number'",
    "mut_fit_5_9": "content.degrees_of_freedom: None is not of type 'integer'",
    "mut_lin_5_5": "content.inputs: ",
    "mut_lin_5_9": "set: 2.5 is not of type 'object'",
    "mut_modes_5_1": "content.notes: None is not of type 'array'",
    "mut_run_5_11": "freedom: 'constraints' is a required property",
    "mut_sw_5_2": "attributes.sweep: 'set_initial' is a required property",
}


@pytest.mark.parametrize("name", FOUND)
def test_files_that_ended_with_tracebacks(tmp_path: Path, name: str) -> None:
    path = Path(__file__).parents[1] / "found" / "contents" / f"{name}.h5"
    page = ["-o", str(tmp_path / "out.html")]
    for command in (["info"], ["report", *page]):
        status, text = answer(*command, str(path))
        assert (status, text.count("\n")) == (4, 1), text
        assert f"cannot read {path}: " in text
        assert FOUND[name] in text


def test_a_comparison_without_an_optional_part_is_read(
    tmp_path: Path, originals: Originals
) -> None:
    path = tmp_path / "models.h5"
    with changed(path, originals["models"]) as root:
        content = json.loads(root.attrs["content"])
        for x in content["multipliers"]:
            del x["explained"]
        root.attrs["content"] = np.bytes_(json.dumps(content))
    for arguments in (["info", str(path)], ["report", str(path), "-o", str(tmp_path / "r.html")]):
        status, said = answer(*arguments)
        assert status == 0, said


@pytest.mark.parametrize("value", [1e308, -1e-308, 1e80])
def test_forces_too_large_or_small_to_be_drawn(
    tmp_path: Path, originals: Originals, value: float
) -> None:
    path = tmp_path / "run.h5"
    with changed(path, originals["run"]) as root:
        root["constraint_force_by"][3:7] = value
    status, said = answer("report", str(path), "-o", str(tmp_path / "r.html"))
    assert status in (0, 2), said
    assert "Warning" not in said


@pytest.mark.parametrize(("part", "number"), [("velocity", 1e308), ("position", 0.0)])
def test_modes_without_a_finite_motion(
    tmp_path: Path, originals: Originals, part: str, number: float
) -> None:
    path = tmp_path / "modes.h5"
    with changed(path, originals["modes"]) as root:
        content = json.loads(root.attrs["content"])
        for name in content["modes"][0][part]:
            content["modes"][0][part][name] = [number, number]
        root.attrs["content"] = np.bytes_(json.dumps(content))
    page = ["-o", str(tmp_path / "out.html")]
    for command in (["report", str(path)], ["animate", str(path), "--mode", "1"]):
        status, said = answer(*command, *page)
        assert status == 3
        assert "has no finite values" in said
        assert "Traceback" not in said


def test_a_mode_about_a_point_whose_square_overflows(tmp_path: Path, originals: Originals) -> None:
    path = tmp_path / "rolling.h5"
    with changed(path, originals["rolling"]) as root:
        content = json.loads(root.attrs["content"])
        content["operating_point"]["q"]["psi"] = 1e308
        root.attrs["content"] = np.bytes_(json.dumps(content))
    status, said = answer("animate", str(path), "--mode", "1", "-o", str(tmp_path / "out.html"))
    assert status == 0, said
    assert "Warning" not in said


def test_infinite_places_of_pins(tmp_path: Path, originals: Originals) -> None:
    path = tmp_path / "road.h5"
    with changed(path, originals["road"]) as root:
        root["q"][2] = 1e308
        root["q"][3] = np.inf
    status, said = answer("animate", str(path), "-o", str(tmp_path / "out.html"))
    assert status in (0, 3), said
    assert "Warning" not in said


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"m": "foo"}, "'foo' is not of type 'object'"),
        ({"m": {"unit": "g", "factor": 0}}, "0 is less than or equal to the minimum"),
    ],
)
def test_given_units_of_runs_that_are_compared(
    tmp_path: Path, originals: Originals, given: dict[str, object], what: str
) -> None:
    other, path = tmp_path / "other.h5", tmp_path / "run.h5"
    with changed(other, originals["run"]) as root:
        values = json.loads(root.attrs["parameters"])
        root.attrs["parameters"] = np.bytes_(json.dumps(values | {"m": 2.0}))
    with changed(path, originals["run"]) as root:
        display = json.loads(root.attrs["display"])
        root.attrs["display"] = np.bytes_(json.dumps(display | {"given_units": given}))
    status, said = answer("plot", str(path), str(other), "-o", str(tmp_path / "out.svg"))
    assert status == 4, said
    assert "display.given_units.m" in said
    assert what in said


@pytest.mark.parametrize("option", ["rtol", "atol", "method", "formulation"])
def test_an_option_of_a_run_that_is_a_list(
    tmp_path: Path, originals: Originals, option: str
) -> None:
    path = tmp_path / "run.h5"
    with changed(path, originals["run"]) as root:
        options = json.loads(root.attrs["options"])
        root.attrs["options"] = np.bytes_(json.dumps(options | {option: [[]]}))
    status, said = answer("report", str(path), "-o", str(tmp_path / "out.html"))
    assert status == 4, said
    assert f"options.{option}: [[]] is not" in said


@pytest.mark.parametrize(
    ("dataset", "shape"),
    [("multipliers", (4, 5, 2)), ("energy_potential", (4, 5, 1)), ("peak", (4, 5)), ("q", (4, 5))],
)
def test_a_sweep_with_an_array_of_another_shape(
    tmp_path: Path, originals: Originals, dataset: str, shape: tuple[int, ...]
) -> None:
    path = tmp_path / "sweep.h5"
    with changed(path, originals["sweep"]) as root:
        del root[dataset]
        root[dataset] = np.ones(shape)
    status, said = answer("report", str(path), "-o", str(tmp_path / "out.html"))
    assert status == 4, said
    assert f"{dataset} has shape {shape}, and not (4" in said


@pytest.mark.parametrize(
    ("command", "kind", "names"),
    [
        ("plot", "svg", ["time", "measured", "model"]),
        ("report", "html", ["model"]),  # it contains the same plot
        pytest.param("report", "html", ["time", "measured"], marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("values", some([(-1e308, 1e308), (0.0, 1e308), (1e308, 1e308)], 1))
def test_numbers_too_large_for_an_axis(
    tmp_path: Path,
    originals: Originals,
    values: tuple[float, float],
    command: str,
    kind: str,
    names: list[str],
) -> None:
    path = tmp_path / "fit.h5"
    for name in names:
        with changed(path, originals["fit"]) as root:
            root["data_1"][name][0], root["data_1"][name][1:] = values
        target = tmp_path / f"{name}.{kind}"
        status, said = answer(command, str(path), "-o", str(target), "--force")
        assert status == 0, f"{name}: {command}: {said}"


def test_residuals_whose_squares_overflow(tmp_path: Path, originals: Originals) -> None:
    path = tmp_path / "fit.h5"
    with changed(path, originals["fit"]) as root:
        root["data_1"]["sigmas"][...] = 1e-200
        measured, model = root["data_1"]["measured"][()], root["data_1"]["model"][()]
    status, said = answer("info", str(path))
    assert status == 0, said
    rms = np.sqrt(np.mean((measured - model) ** 2)) / 1e-200
    assert f"rms x {rms:.3g} sigma" in said


@pytest.mark.parametrize("kind", some(FILES, 2))
def test_a_few_wrong_contents(tmp_path: Path, originals: Originals, kind: str) -> None:
    try_mutants(kind, originals[kind], tmp_path, FEW)


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", FILES)
def test_many_wrong_contents(tmp_path: Path, originals: Originals, kind: str) -> None:
    print(f"{kind}: {dict(try_mutants(kind, originals[kind], tmp_path, FUZZ_COUNT))}")
