"""The mutants of a file: which places change, and that comments and strings do not."""

from __future__ import annotations

from mutate import (
    AREAS,
    EXPLAINED,
    ROOT,
    Mutant,
    code_of,
    explained,
    files_of,
    keys_of,
    mutants_of,
)

C = """/* a < b */
int less(double a, double b)
{
    count += 1;
    return a < b && !isnan(fmin(a, 0.5)) ? 1 : 0; /* 2 */
}
"""
PYTHON = '''def less(a, b):
    """Return a < b."""
    return a < b and "a < b" != a  # a < b
'''


def changed(file: str, text: str) -> list[str]:
    """Return the changed lines of all mutants."""
    return [m.change(text).partition(" => ")[2] for m in mutants_of(file, text)]


def test_comments_and_strings_are_blank() -> None:
    for file, text in (("x.c", C), ("x.py", PYTHON)):
        code = code_of(file, text)
        assert len(code) == len(text)
        assert code.count("a < b") == 1
        assert code.count("\n") == text.count("\n")


def test_mutants_of_c() -> None:
    found = changed("x.c", C)
    rest = "? 1 : 0; /* 2 */"
    assert f"return a <= b && !isnan(fmin(a, 0.5)) {rest}" in found
    assert f"return a < b || !isnan(fmin(a, 0.5)) {rest}" in found
    assert f"return a < b && !isnan(fmax(a, 0.5)) {rest}" in found
    assert f"return a < b && !isnan(fmin(a, (2.0 * 0.5))) {rest}" in found
    assert "count -= 1;" in found
    assert "count += 0;" in found
    assert ";" in found  # without the statement
    assert len(found) == len(set(found)) == 9


def test_mutants_of_python() -> None:
    assert changed("x.py", PYTHON) == [
        'return a <= b and "a < b" != a # a < b',
        'return a < b or "a < b" != a # a < b',
        'return a < b and "a < b" == a # a < b',
    ]


def test_a_mutant_is_described_by_its_line() -> None:
    mutant = Mutant("x.py", PYTHON.index(" < b and"), PYTHON.index(" < b and") + 3, " <= ")
    assert mutant.described(PYTHON).splitlines()[0] == "--- x.py"
    assert mutant.applied(PYTHON).count("<=") == 1


def test_keys_name_the_function_and_are_unique() -> None:
    c = """#define MOST 2
static const int most[] = {
    3,
};

static int first(const double *x,
                 int n)
{
    n += 4;
    n += 4;
    return n;
}

struct pair second(void)
{
    n += 4;
}
int last = 5;
"""
    python = """MOST = 2

class First:
    def second(self, x: int) -> int:
        return x + 3

    def third(self) -> int:
        return 4

FIFTH = 5
"""
    for file, text, places in (
        ("x.c", c, ["", "", "first", "first 2", "second", ""]),
        ("x.py", python, ["", "second", "third", ""]),
    ):
        keys = keys_of(file, text)
        assert list(keys.values()) == list(mutants_of(file, text))
        doubled = [key for key, mutant in keys.items() if mutant.new.startswith("(2 * ")]
        expected = [f"{file} {place}".rstrip() for place in places]
        assert [key.partition(":")[0] for key in doubled] == expected


def test_the_files_of_all_areas_exist() -> None:
    for area in AREAS.values():
        files = files_of(area)
        assert files
        assert all((ROOT / name).exists() for name in (*files, *area.tests))


def test_what_is_explained_is_a_mutant_and_has_a_reason() -> None:
    texts = {f: (ROOT / f).read_text("utf-8") for area in AREAS.values() for f in files_of(area)}
    keys = {key for file, text in texts.items() for key in keys_of(file, text)}
    assert explained() <= keys
    groups = EXPLAINED.read_text("utf-8").strip().split("\n\n")[1:]
    assert groups
    for group in groups:
        lines = group.splitlines()
        first = next(k for k, line in enumerate(lines) if line.startswith("    "))
        assert first > 0
        assert all(line.startswith("    ") for line in lines[first:])
