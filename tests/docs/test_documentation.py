"""The documentation says what is so: commands are run, options and keys are looked up."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lagcli.cli import app
from lagcli.settings.methods import METHODS
from lagcli.settings.settings import Settings

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def console_blocks(page):
    """Yield (command, expected output) of each console block, in order."""
    for block in re.findall(r"```console\n(.*?)```", page.read_text(), re.S):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, output = part.partition("\n")
            yield command, output


def same(word, other):
    """Compare words; numbers may differ as another machine's rounding and clock make them."""
    if word == other:
        return True
    try:
        a, b = float(word.rstrip(",;")), float(other.rstrip(",;"))
    except ValueError:
        return False
    # rounding errors and times have no digits to compare; the rest has three, or a few counts
    return max(abs(a), abs(b)) < 1e-6 or abs(a - b) <= max(1e-3 * max(abs(a), abs(b)), 0)


VOLATILE = re.compile(
    r"^\s*(time\s+\d|seconds|derive =|counts|method|energy|residuals|file|parameters|options)"
)


def test_readme_console_blocks_print_what_they_say(tmp_path):
    shutil.copytree(ROOT / "models", tmp_path / "models")
    blocks = list(console_blocks(ROOT / "README.md"))
    assert len(blocks) >= 2
    for command, expected in blocks:
        assert expected.strip(), f"{command}: the page shows no output"
        words = shlex.split(command)
        assert words[0] == "lagcli"
        done = subprocess.run(
            [sys.executable, "-m", "lagcli", *words[1:]],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode == 0, done.stderr
        got, want = done.stdout.rstrip().split("\n"), expected.rstrip().split("\n")
        assert len(got) == len(want), f"{command}: {len(got)} lines, the page shows {len(want)}"
        for line, shown in zip(got, want, strict=True):
            if VOLATILE.match(shown):
                assert line.split()[0] == shown.split()[0]
                continue
            a, b = line.split(), shown.split()
            alike = len(a) == len(b) and all(map(same, a, b))
            assert alike, f"{command}:\n{line}\n{shown}"


def test_readme_names_the_two_commands_and_they_are_targets():
    readme, makefile = (ROOT / "README.md").read_text(), (ROOT / "Makefile").read_text()
    for target in ("demo", "test"):
        assert f"`make {target}`" in readme
        assert re.search(rf"^{target}:", makefile, re.M)
    assert "make test" in (ROOT / ".ci" / "run").read_text()


@pytest.mark.parametrize("command", app.COMMANDS)
def test_every_option_is_documented(command):
    page = (ROOT / "docs" / "command-line.md").read_text()
    options = app.command(command).params
    names = [n for p in options for n in p.opts if n.startswith("--")]
    assert f"## lagcli {command}" in page
    assert not [n for n in names if n != "--help" and f"`{n}" not in page]


def test_every_model_key_and_function_is_documented():
    from lagcli.functions import FUNCTIONS
    from lagcli.model.keys import keys_of
    from lagcli.model.loader import MODEL
    from lagcli.model.names.building import TENSOR_FUNCTIONS

    page = (ROOT / "docs" / "model-file.md").read_text()
    words = set(re.findall(r"\w+", page))
    names = [*keys_of(MODEL), *FUNCTIONS, *TENSOR_FUNCTIONS]
    assert not [n for n in names if n not in words]


def test_tables_have_every_setting_and_every_method():
    page = (ROOT / "docs" / "command-line.md").read_text()
    for name in [*Settings.DECLARED, *METHODS]:
        assert f"| `{name}` |" in page, name


def test_summary_keys_are_documented(tmp_path):
    import json

    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "lagcli",
            "simulate",
            str(ROOT / "models" / "atwood.yaml"),
            "--json",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    page = (ROOT / "docs" / "command-line.md").read_text()
    assert not [key for key in json.loads(done.stdout) if f"`{key}`" not in page]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


def test_every_file_and_function_named_in_backquotes_exists():
    import lagcli

    for page in PAGES:
        text = page.read_text()
        for name in re.findall(r"`lagcli\.(\w+)`", text):
            assert hasattr(lagcli, name), name
        for path in re.findall(r"`((?:models|docs|tests|lagcli)/[\w./]*)`", text):
            assert (ROOT / path).exists(), path
