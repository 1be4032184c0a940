"""Mutation testing: change the code in one place at a time, and see whether a test fails.

    python tests/mutation/mutate.py [AREA ...] [--count N] [--seed S] [--list]

Each mutant is tried in a copy of the checkout: the core is built, which compiles what has changed,
and the tests of its area run until one fails: the mutant is killed. `explained.txt` lists survivors
that do not change the behavior, with the reason. The exit status is 1 if less than 90 % of the
mutants of an area are killed or explained.
"""

from __future__ import annotations

import argparse
import difflib
import io
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
EXPLAINED = Path(__file__).with_name("explained.txt")
LEAST = 0.9
#: Time limit of the tests of one mutant, s: a mutant that does not end is killed.
PATIENCE = 900


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
            "lagcli/engine/core/roots.c",
        ),
        (
            "tests/physics/test_roots_within_steps.py",
            "tests/physics/test_known_events.py",
            "tests/physics/test_clocked_events.py",
            "tests/physics/test_kinked_motions.py",
            "tests/unit/engine/switching",
            "tests/unit/engine/core",
            "tests/physics/test_contact_models.py",
            "tests/physics/test_actions_at_instants.py",
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
            "tests/unit/engine/core",
            "tests/unit/engine/switching",
            "tests/physics/test_contact_cases.py",
            "tests/physics/test_contact_models.py",
            "tests/physics/test_ball_to_rest.py",
            "tests/physics/test_ends_of_impacts.py",
            "tests/physics/test_textbook_contacts.py",
            "tests/physics/test_undetermined_contacts.py",
        ),
    ),
    "units": Area(
        (
            "lagcli/model/expression/units.py",
            "lagcli/model/dimensions",
        ),
        (
            "tests/unit/model/expression",
            "tests/unit/model/dimensions",
            "tests/property/test_units_everywhere.py",
            "tests/physics/test_other_units.py",
            "tests/cli/test_check.py",
        ),
    ),
    "rank": Area(
        (
            "lagcli/engine/constraints/singular.py",
            "lagcli/analysis/check/rank.py",
            "lagcli/engine/core/watch.c",
        ),
        (
            "tests/unit/engine/constraints",
            "tests/unit/analysis/check",
            "tests/unit/engine/core",
            "tests/cli/test_check.py",
            "tests/physics/test_found_mechanisms.py",
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
#: A statement that calls or assigns, and can be left out.
_STATEMENT = re.compile(r"^( +)((?:\w[\w.>\[\]-]*(?: [-+*/|&]?= |\().*);)$", re.MULTILINE)
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

    def key(self, text: str) -> str:
        """Return the changed lines without their numbers, as `explained.txt` has them."""
        pair = (text.splitlines(), self.applied(text).splitlines())
        lines = list(difflib.unified_diff(*pair, lineterm="", n=0))[3:]
        return f"{self.file}: " + " => ".join(" ".join(line[1:].split()) for line in lines)


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


def mutants_of(file: str, text: str) -> Iterator[Mutant]:
    """Yield the mutants of a file."""
    code = code_of(file, text)
    for found in _OPERATOR.finditer(code):
        yield Mutant(file, found.start(), found.end(), _SWAPPED[found[0]])
    for found in _NUMBER.finditer(code):
        number = found[1]
        new = "1" if number == "0" else "0" if number == "1" else f"(2 * {number})"
        if "." in number or "e" in number:
            new = "1.0" if float(number) == 0 else f"(2.0 * {number})"
        yield Mutant(file, found.start(1), found.end(1), new)
    if file.endswith(".c"):
        for found in _STATEMENT.finditer(code):
            yield Mutant(file, found.start(2), found.end(2), ";")


def explained() -> set[str]:
    """Return the keys of survivors that do not change the behavior."""
    if not EXPLAINED.exists():
        return set()
    lines = EXPLAINED.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line and not line.startswith(("#", " "))}


class Copy:
    """A copy of the checkout in which mutants are tried.

    The core is built before each run of tests: only what has changed since the last is compiled.
    """

    def __init__(self, folder: Path):
        self.folder = folder
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
        """Build the core; return whether it compiles."""
        command = [sys.executable, "building/core_library.py"]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, check=False)
        return done.returncode == 0

    def passes(self, tests: tuple[str, ...]) -> bool:
        """Return whether all tests pass, within the time limit."""
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
        try:
            done = subprocess.run(
                command, cwd=self.folder, capture_output=True, timeout=PATIENCE, check=False
            )
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0

    def kills(self, mutant: Mutant, tests: tuple[str, ...]) -> bool | None:
        """Return whether a test fails with a mutant; None if that does not compile."""
        path = self.folder / mutant.file
        text = path.read_text(encoding="utf-8")
        path.write_text(mutant.applied(text), encoding="utf-8")
        try:
            return not self.passes(tests) if self.build() else None
        finally:
            path.write_text(text, encoding="utf-8")


def files_of(area: Area) -> list[str]:
    """Return the files of an area; folders stand for their Python modules."""
    found: list[str] = []
    for name in area.files:
        path = ROOT / name
        inside = sorted(path.glob("*.py")) if path.is_dir() else [path]
        found += [str(file.relative_to(ROOT)) for file in inside]
    return found


def run(name: str, count: int, seed: int) -> bool:
    """Try mutants of an area, print the survivors, and return whether few enough survive."""
    area, known = AREAS[name], explained()
    texts = {file: (ROOT / file).read_text(encoding="utf-8") for file in files_of(area)}
    every = [mutant for file, text in texts.items() for mutant in mutants_of(file, text)]
    order = random.Random(seed).sample(every, len(every))
    killed = survived = excused = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        if not (copy.build() and copy.passes(area.tests)):
            print(f"{name}: the core does not compile, or tests fail, without a mutant")
            return False
        for mutant in order:
            if killed + survived + excused >= count:
                break
            outcome = copy.kills(mutant, area.tests)
            if outcome is None:
                continue
            text = texts[mutant.file]
            if outcome:
                killed += 1
            elif mutant.key(text) in known:
                excused += 1
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
    parser.add_argument("areas", nargs="*", default=list(AREAS), choices=[*AREAS, []])
    parser.add_argument("--count", type=int, default=40, help="mutants of each area")
    parser.add_argument("--seed", type=int, default=1, help="of the choice of mutants")
    parser.add_argument("--list", action="store_true", help="print the mutants, and try none")
    given = parser.parse_args()
    if given.list:
        for name in given.areas:
            for file in files_of(AREAS[name]):
                text = (ROOT / file).read_text(encoding="utf-8")
                for mutant in mutants_of(file, text):
                    print(mutant.key(text))
        return 0
    enough = [run(name, given.count, given.seed) for name in given.areas]
    return 0 if all(enough) else 1


if __name__ == "__main__":
    sys.exit(main())
