"""Mutation testing: change the code in one place at a time, and see whether a test fails.

    python tests/mutation/mutate.py [AREA ...] [--count N] [--seed S] [--list]

Each mutant is tried in a copy of the checkout: the core is built, which compiles what has changed,
and the tests of its area run until one fails: the mutant is killed. Tests that have failed before
come first, then those that take little time. Mutants in C from which the compiler makes the same
code are left out. `explained.txt` lists survivors that do not change what is promised, with the
reason. The exit status is 1 if less than 90 % of the mutants of an area are killed or explained.
"""

from __future__ import annotations

import argparse
import difflib
import importlib.util
import io
import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tokenize
from collections import Counter
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
EXPLAINED = Path(__file__).with_name("explained.txt")
LEAST = 0.9
#: CPU time of one test, s, after which a mutant counts as killed: it does not end.
PATIENCE = 30
#: The same of the time that a test may take with all processes that it starts.
LONGEST = 600
#: What tests import, and no mutant changes: it is imported once.
_PRELOADED = ["pytest", "hypothesis", "scipy.optimize", "scipy.integrate", "sympy", "symengine"]


class Area(NamedTuple):
    """Files to mutate, and the tests that should notice."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


AREAS = {
    "search": Area(
        (
            "lagcli/engine/core/switching/search.c",
            "lagcli/engine/core/switching/watched.c",
            "lagcli/engine/core/switching/enclosure.c",
            "lagcli/engine/core/switching/crossing.c",
            "lagcli/engine/core/dense_jets.c",
            "lagcli/engine/core/roots.c",
        ),
        (
            "tests/unit/engine/core/test_roots.py",
            "tests/unit/engine/core/test_crossing.py",
            "tests/unit/engine/core/test_core_switching.py",
            "tests/unit/engine/core/test_enclosure.py",
            "tests/physics/test_roots_within_steps.py",
            "tests/physics/test_bending_motions.py",
            "tests/unit/engine/switching/test_kinks.py",
            "tests/unit/engine/switching/test_stops.py",
            "tests/physics/test_kinked_motions.py",
            "tests/physics/test_actions_at_instants.py",
            "tests/physics/test_known_events.py",
        ),
    ),
    "contact": Area(
        (
            "lagcli/engine/core/contact/solver.c",
            "lagcli/engine/core/contact/modes.c",
            "lagcli/engine/core/contact/lemke.c",
            "lagcli/engine/core/contact/least_distance.c",
            "lagcli/engine/core/contact/sharing.c",
            "lagcli/engine/core/contact/impact.c",
            "lagcli/engine/core/switching/impulse.c",
            "lagcli/engine/core/switching/accumulation.c",
        ),
        (
            "tests/unit/engine/core/test_contact.py",
            "tests/unit/engine/core/test_contact_sharing.py",
            "tests/unit/engine/core/test_contact_two_programs.py",
            "tests/unit/engine/switching/test_stops.py",
            "tests/physics/test_contact_cases.py",
            "tests/physics/test_contact_models.py",
            "tests/physics/test_ball_to_rest.py",
            "tests/physics/test_ends_of_impacts.py",
            "tests/physics/test_impacts_at_one_instant.py",
            "tests/physics/test_impacts_of_mechanisms.py",
            "tests/physics/test_mechanisms_side_by_side.py",
            "tests/physics/test_origins_of_contacts.py",
            "tests/physics/test_sensitivities_through_events.py",
            "tests/physics/test_textbook_contacts.py",
            "tests/physics/test_undetermined_contacts.py",
        ),
    ),
    "units": Area(
        (
            "lagcli/model/expression/units.py",
            "lagcli/model/expression/unit_table.py",
            "lagcli/model/dimensions",
        ),
        (
            "tests/unit/model/expression/test_units.py",
            "tests/unit/model/expression/test_dimension.py",
            "tests/unit/model/dimensions",
            "tests/property/test_units_everywhere.py",
            "tests/physics/test_other_units.py",
        ),
    ),
    "rank": Area(
        (
            "lagcli/engine/constraints/singular.py",
            "lagcli/engine/constraints/random_states.py",
            "lagcli/analysis/check/rank.py",
            "lagcli/engine/core/watch.c",
        ),
        (
            "tests/unit/engine/core/test_core_watch.py",
            "tests/unit/engine/constraints/test_singular.py",
            "tests/unit/engine/constraints/test_random_states.py",
            "tests/unit/analysis/check/test_rank.py",
            "tests/unit/engine/integrate/test_watch.py",
            "tests/physics/test_found_mechanisms.py",
            "tests/physics/test_singular_configurations.py",
        ),
    ),
}

#: Replacements of operators, which both languages write between spaces.
_SWAPPED = {
    " < ": " <= ",
    " <= ": " < ",
    " > ": " >= ",
    " >= ": " > ",
    " == ": " != ",
    " != ": " == ",
    " + ": " - ",
    " - ": " + ",
    " * ": " / ",
    " / ": " * ",
    " += ": " -= ",
    " -= ": " += ",
    " && ": " || ",
    " || ": " && ",
    " and ": " or ",
    " or ": " and ",
    "fmin(": "fmax(",
    "fmax(": "fmin(",
    "min(": "max(",
    "max(": "min(",
    "if (!": "if (",
    " not ": " ",
}
_OPERATOR = re.compile("|".join(re.escape(x) for x in sorted(_SWAPPED, key=len, reverse=True)))
_NUMBER = re.compile(r"(?<![\w.])(\d+\.?\d*(?:e-?\d+)?)(?![\w.])")
#: The value of bytes that are set.
_ZEROS = re.compile(r"memset\([^;]*?, (0),")
#: A statement that calls or assigns, and can be left out.
_STATEMENT = re.compile(r"^( +)((?:\w[\w.>\[\]-]*(?: [-+*/|&]?= |\().*);)$", re.MULTILINE)
#: Where a function begins, and where what is in it ends.
_FUNCTION = {
    ".c": re.compile(r"^\w[^;#{}()=]*?(\w+)\([^;{}]*\)\n\{|^(?=\})", re.MULTILINE),
    ".py": re.compile(r"^ *(?:def|class) (\w+)|^(?=[\w@#])", re.MULTILINE),
}
_C_TEXT = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\])*"|^#include.*?$', re.DOTALL | re.MULTILINE)


class Mutant(NamedTuple):
    """One change of a file: the text between two positions is replaced."""

    file: str
    start: int
    end: int
    new: str

    def applied(self, text: str) -> str:
        """Return the changed text."""
        return text[: self.start] + self.new + text[self.end :]

    def described(self, text: str) -> str:
        """Return the changed line, before and after, under the file's name."""
        pair = (text.splitlines(), self.applied(text).splitlines())
        lines = list(difflib.unified_diff(*pair, self.file, self.file, lineterm="", n=0))
        return "\n".join([lines[0], *lines[2:]])

    def change(self, text: str) -> str:
        """Return the changed line, before and after, without its indentation."""
        first = text.rfind("\n", 0, self.start) + 1
        last = text.find("\n", self.end)
        before = text[first : last if last >= 0 else len(text)]
        after = before[: self.start - first] + self.new + before[self.end - first :]
        return f"{' '.join(before.split())} => {' '.join(after.split())}"


def code_of(file: str, text: str) -> str:
    """Return a text of the same length whose comments and strings are blank."""
    if file.endswith(".c"):
        return _C_TEXT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    lines = text.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    code = list(text)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.COMMENT, tokenize.STRING):
            (row, column), (last, end) = token.start, token.end
            for i in range(starts[row - 1] + column, starts[last - 1] + end):
                if code[i] != "\n":
                    code[i] = " "
    return "".join(code)


def function_at(file: str, text: str, position: int) -> str:
    """Return the name of the function or class at a position, an empty one between functions."""
    begun = list(_FUNCTION[Path(file).suffix].finditer(text, 0, position))
    return begun[-1][1] or "" if begun else ""


def mutants_of(file: str, text: str) -> Iterator[Mutant]:
    """Yield the mutants of a file."""
    code = code_of(file, text)
    for found in _OPERATOR.finditer(code):
        yield Mutant(file, found.start(), found.end(), _SWAPPED[found[0]])
    zeros = {found.start(1) for found in _ZEROS.finditer(code)}
    for found in _NUMBER.finditer(code):
        number = found[1]
        new = "1" if number == "0" else "0" if number == "1" else f"(2 * {number})"
        if found.start(1) in zeros:
            new = "-1"  # NaN; bytes 1 are the number 7.7e-304
        elif "." in number or "e" in number:
            new = "1.0" if float(number) == 0 else f"(2.0 * {number})"
        yield Mutant(file, found.start(1), found.end(1), new)
    if file.endswith(".c"):
        for found in _STATEMENT.finditer(code):
            yield Mutant(file, found.start(2), found.end(2), ";")


def keys_of(file: str, text: str) -> dict[str, Mutant]:
    """Return the mutants of a file by the keys that `explained.txt` has: FILE FUNCTION: CHANGE.

    Where equal lines of a function have the same change, the function of the second one is
    FUNCTION 2. Between functions there is no name.
    """
    found: dict[str, Mutant] = {}
    times: Counter[tuple[str, str]] = Counter()
    for mutant in mutants_of(file, text):
        place = f"{file} {function_at(file, text, mutant.start)}".rstrip()
        change = mutant.change(text)
        times[place, change] += 1
        number = times[place, change]
        found[f"{place}: {change}" if number == 1 else f"{place} {number}: {change}"] = mutant
    return found


def explained() -> set[str]:
    """Return the keys of survivors that do not change the behavior."""
    if not EXPLAINED.exists():
        return set()
    lines = EXPLAINED.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line and not line.startswith(("#", " "))}


class Outcome(NamedTuple):
    """What the tests of an area say: the one that failed, or None, and the CPU times of all."""

    failed: str | None
    durations: dict[str, float]


class _Watch:
    """A plugin of pytest that orders the tests, limits their CPU time, and notes what they do."""

    def __init__(self, first: dict[str, float], sender: Connection):
        self.first, self.sender = first, sender
        self.failed: str | None = None
        self.durations: dict[str, float] = {}
        self.started = 0.0

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items.sort(key=lambda item: self.first.get(item.nodeid, 0.0))

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.sender.send(nodeid)
        self.started = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)  # its signal ends the process

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed = report.nodeid

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0)
        self.durations[nodeid] = time.process_time() - self.started

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        if exitstatus and self.failed is None:
            self.failed = "the collection of tests"
        self.sender.send(Outcome(self.failed, self.durations))


def _run_tests(
    folder: Path, tests: tuple[str, ...], first: dict[str, float], sender: Connection
) -> None:
    """Run tests in a copy of the checkout: the task of a process of its own."""
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    os.environ["PYTHONPATH"] = str(folder)  # of processes that tests start
    import pytest

    with open(os.devnull, "w") as nothing:
        for output in (1, 2):  # also of the sanitizer
            os.dup2(nothing.fileno(), output)
    pytest.main(["-q", "-x", "-p", "no:cacheprovider", *tests], plugins=[_Watch(first, sender)])


class Copy:
    """A copy of the checkout in which mutants are tried.

    The core is built before each run of tests: only what has changed since the last is compiled.
    """

    def __init__(self, folder: Path, tests: tuple[str, ...]):
        self.folder, self.tests = folder, tests
        self.kills: Counter[str] = Counter()
        self.durations: dict[str, float] = {}
        self._objects: dict[str, list[bytes]] = {}
        self._processes = multiprocessing.get_context("forkserver")
        self._processes.set_forkserver_preload(_PRELOADED)
        # the tests' processes begin with what the core needs
        compiler = os.environ.get("CC", "cc").split()
        sanitizer = [*compiler, "-print-file-name=libasan.so"]
        os.environ["LD_PRELOAD"] = subprocess.check_output(sanitizer, text=True).strip()
        os.environ["ASAN_OPTIONS"] = "detect_leaks=0"
        names = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"],
            cwd=ROOT,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.splitlines()
        for name in names:
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / name).is_file():
                shutil.copy2(ROOT / name, target)

    def build(self) -> bool:
        """Build the core, fast rather than fast to run; return whether it compiles.

        An index beyond an array ends the process.
        """
        command = [sys.executable, "building/core_library.py"]
        flags = "-fsanitize=address,bounds -fsanitize-undefined-trap-on-error"
        environment = {**os.environ, "CFLAGS": f"-O1 {flags}", "LDFLAGS": flags, "LD_PRELOAD": ""}
        done = subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, check=False
        )
        return done.returncode == 0

    def _made_of(self, file: str) -> list[bytes]:
        """Return what the compiler has made of a file, nothing of a Python module."""
        name = file.removeprefix("lagcli/engine/core/").replace("/", "_")
        return [x.read_bytes() for x in sorted(self.folder.glob(f"build/core/*/{name}.o"))]

    def failing(self) -> str | None:
        """Return a test that fails, or does not end in time, or None."""
        times = self.durations
        order = {test: times[test] / (1 + 100 * self.kills[test]) for test in times}
        receiver, sender = self._processes.Pipe(duplex=False)
        process = self._processes.Process(
            target=_run_tests, args=(self.folder, self.tests, order, sender)
        )
        process.start()
        sender.close()
        last = "the start of the tests"
        outcome: Any = None
        try:
            while not isinstance(outcome, Outcome):
                if not receiver.poll(LONGEST):
                    process.kill()
                outcome = receiver.recv()
                last = last if isinstance(outcome, Outcome) else outcome
        except EOFError:  # the process has ended
            outcome = Outcome(last, {})
        process.join()
        if outcome.failed is None:
            self.durations = outcome.durations
        else:
            self.kills[outcome.failed] += 1
        return outcome.failed

    def killer(self, mutant: Mutant) -> str | None:
        """Return a test that fails with a mutant, or None.

        Raises
        ------
        Same
            The compiler rejects the mutant, or makes the same code of it.
        """
        path = self.folder / mutant.file
        text = path.read_text(encoding="utf-8")
        usual = self._objects.setdefault(mutant.file, self._made_of(mutant.file))
        path.write_text(mutant.applied(text), encoding="utf-8")
        try:
            if not self.build() or (usual and self._made_of(mutant.file) == usual):
                raise Same
            return self.failing()
        finally:
            path.write_text(text, encoding="utf-8")
            if path.suffix == ".py":  # the next change may be as long, within the same second
                Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)


class Same(Exception):
    """A mutant that is none."""


def files_of(area: Area) -> list[str]:
    """Return the files of an area; folders stand for their Python modules."""
    found: list[str] = []
    for name in area.files:
        path = ROOT / name
        inside = sorted(path.glob("*.py")) if path.is_dir() else [path]
        found += [str(file.relative_to(ROOT)) for file in inside]
    return found


def run(name: str, count: int, seed: int, folder: Path) -> bool:
    """Try mutants of an area, print the survivors, and return whether few enough survive."""
    area, known = AREAS[name], explained()
    texts = {file: (ROOT / file).read_text(encoding="utf-8") for file in files_of(area)}
    every = [item for file, text in texts.items() for item in keys_of(file, text).items()]
    killed = survived = excused = 0
    copy = Copy(folder, area.tests)
    failed = copy.failing() if copy.build() else "the core does not compile"
    if failed is not None:
        print(f"{name}: without a mutant: {failed}")
        return False
    for key, mutant in random.Random(seed).sample(every, len(every)):
        if killed + survived + excused >= count:
            break
        text = texts[mutant.file]
        if key in known:
            excused += 1
            continue
        try:
            killer = copy.killer(mutant)
        except Same:
            continue
        if killer is not None:
            killed += 1
        else:
            survived += 1
            print(f"{name}: survived\n{mutant.described(text)}", flush=True)
    tried = killed + survived + excused
    share = (killed + excused) / tried if tried else 1.0
    print(
        f"{name}: {tried} of {len(every)} mutants tried: {killed} killed, {excused} explained,"
        f" {survived} survived ({100 * share:.0f} % killed or explained)",
        flush=True,
    )
    return share >= LEAST


def main() -> int:
    """Read the options, and try the areas."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("areas", nargs="*", choices=[*AREAS, []])
    parser.add_argument("--count", type=int, default=40, help="mutants of each area")
    parser.add_argument("--seed", type=int, default=1, help="of the choice of mutants")
    parser.add_argument("--list", action="store_true", help="print the mutants, and try none")
    given = parser.parse_args()
    areas = given.areas or list(AREAS)
    if given.list:
        for name in areas:
            for file in files_of(AREAS[name]):
                text = (ROOT / file).read_text(encoding="utf-8")
                for key in keys_of(file, text):
                    print(key)
        return 0
    enough = []
    for name in areas:
        with tempfile.TemporaryDirectory() as folder:
            enough.append(run(name, given.count, given.seed, Path(folder)))
    return 0 if all(enough) else 1


if __name__ == "__main__":
    sys.exit(main())
