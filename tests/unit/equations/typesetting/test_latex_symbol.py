"""The LaTeX that a coordinate states: what is allowed, and that nothing else reaches any output."""

from __future__ import annotations

import itertools
import json
import random
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import FORMATS, render
from lagcli.equations.typesetting.latex_symbol import (
    ACCENTS,
    FONTS,
    MARKS,
    SYMBOLS,
    InvalidLatex,
    parse,
    to_latex,
)
from lagcli.equations.typesetting.notation import Notation, invalid_latex_warnings, symbol_mathml
from lagcli.model.loader import load, load_text

HOSTILE = sorted((Path(__file__).parents[3] / "found" / "hostile").glob("latex-*.yaml"))
#: Commands of TeX, LaTeX and pdfTeX that read, write, define, expand, end, or switch the reading.
FORBIDDEN = """
    input include InputIfFileExists IfFileExists @@input usepackage RequirePackage openin openout
    read readline write write18 newread newwrite immediate special def gdef edef xdef let
    futurelet newcommand renewcommand providecommand csname endcsname expandafter noexpand string
    scantokens catcode lccode uccode active makeatletter makeatother begin end enddocument stop
    bye endinput loop repeat message errmessage show showthe jobname pdffiledump pdfobj pdfextension
    directlua luaexec ShellEscape href url verb verbatiminput lstinputlisting includegraphics
    typeout typein everypar everymath output hbox vbox mbox par left right frac bf rm
""".split()  # noqa: SIM905 - a list of quoted words is harder to read

MODEL = """
coordinates: {{x: {{latex: {latex}}}, y: m}}
T: x'^2 + y'^2
V: 0
constraints: {{rod: x^2 + y^2 = 4}}
initial: {{x: 0, x': 0, y: 2, y': 0}}
"""


def model_with(latex: str):
    return load_text(MODEL.format(latex=json.dumps(latex)))


def commands(text: str) -> set[str]:
    return set(re.findall(r"\\(?:[A-Za-z@]+|.)", text, re.DOTALL))


#: What lagcli writes for a model whose coordinates state no LaTeX.
PLAIN = {
    form: commands(render(derive(model_with("x")), form, steps=True))
    for form in ("latex", "markdown")
}
HARMLESS = SYMBOLS | ACCENTS | FONTS | {r"\_"}


def attacks() -> list[str]:
    """Return forbidden commands in the disguises that TeX knows."""
    source = random.Random(24)
    escapes = (
        "\\",
        "^^5c",
        "^^\x1c",
        "^^5C",
        "^^^^005c",
        "\\relax\\",
        "x\\",
        "{\\",
        "_{\\",
        "x^\\",
    )
    found = [
        f"{escape}{name}{rest}"
        for escape, name in itertools.product(escapes, FORBIDDEN)
        for rest in ("", "{/etc/passwd}")
    ]
    found += [
        f"\\mathrm{{{text}}}" for text in ("$x$", "\\input", "}\\input{a}", "%", "#1", "~", "^^5c")
    ]
    found += [
        "x%\n\\input a",
        "$ \\input a $",
        "&",
        "#",
        "~",
        "\u2028",
        "\x00",
        "é",
        "曲",
        "\\",
        "x\\\\y",
    ]
    pieces = [
        *sorted(HARMLESS),
        *sorted(MARKS),
        *"ab1{}_^ \n\\%$&#~",
        "^^5c",
        "\\input",
        "\\def",
        "@",
    ]
    found += ["".join(source.choices(pieces, k=source.randint(1, 9))) for _ in range(3000)]
    return found


def test_no_forbidden_command_reaches_a_sign():
    """What is read is written again from lists: only what these hold can come out."""
    allowed = 0
    for attack in attacks():
        try:
            tree = parse(attack)
        except InvalidLatex:
            continue
        allowed += 1
        latex = to_latex(tree)
        assert commands(latex) <= HARMLESS, (attack, latex)
        assert re.fullmatch(r"[A-Za-z0-9\\ {}_^+\-*/=,.;:()\[\]'|]*", latex), (attack, latex)
        assert "^^" not in latex
        assert latex.count("{") == latex.count("}")
        assert to_latex(parse(latex)) == latex  # and reads back
        ElementTree.fromstring(symbol_mathml(latex))
    assert allowed > 100  # the list is not made of refusals alone


def test_no_forbidden_command_reaches_an_output():
    printable = [x for x in attacks() if not {"\x00", "\x1c"} & set(x)]  # YAML rejects the others
    for attack in printable[:: len(printable) // 25]:
        equations = derive(model_with(attack))
        for form, plain in PLAIN.items():
            found = commands(render(equations, form, steps=True))
            assert found <= plain | HARMLESS, (attack, found - plain)


@pytest.mark.parametrize("path", HOSTILE, ids=lambda p: p.stem)
def test_found_attacks(path):
    model = load(path)
    assert not Notation(model).with_own_latex
    (warning,) = invalid_latex_warnings(model)
    assert warning.location.line == 2
    assert warning.location.text[warning.location.column - 1] == '"'
    assert warning.render().startswith(f"{path}:2:")
    equations = derive(model)
    for form in FORMATS:
        text = render(equations, form, steps=True)
        for word in ("hostname", "pwned", "caret5c", "^^", "openout", "stop", "zz"):
            assert word not in text.replace(model.name, "").replace(model.title, "")


@pytest.mark.parametrize(
    ("latex", "said"),
    [
        (r"\frac{1}{2}", r"`\frac`"),
        ("x_1_2", "second `_`"),
        ("{x", "`}` is missing"),
        ("x}", "no opening brace"),
        ("_", "`_`"),
        ("x_", "ends too early"),
        ("", "empty"),
        ("  ", "empty"),
        (r"\mathrm x", "braces"),
        (r"\mathrm{<b>}", "letters"),
        ("a" * 300, "longer"),
        ("{" * 50 + "}" * 50, "deep"),
        (r"\hat" * 40 + "x", "deep"),
        ("\x1b[31m", "U+001B"),
    ],
)
def test_what_is_rejected_is_reported(latex, said):
    with pytest.raises(InvalidLatex, match=re.escape(said)):
        parse(latex)


@pytest.mark.parametrize(
    ("latex", "written"),
    [
        (r"\vartheta_{1}", r"\vartheta_{1}"),
        (r"\bm{r}", r"\boldsymbol{r}"),
        (r" \dot {q} _i ^ 2", r"\dot{q}_{i}^{2}"),
        (r"\alpha  x\,y", r"\alpha x\,y"),
        (r"{x_1}_2", r"{x_{1}}_{2}"),
        (r"\mathrm{a_b c}", None),
        (r"\mathrm{a\_b c}", r"\mathrm{a\_b c}"),
        (r"x'", "x'"),
        (r"\ ", r"\ "),
    ],
)
def test_signs_are_written_again(latex, written):
    if written is None:  # an underscore in a word is written \_
        written = r"\mathrm{a\_b c}"
    assert to_latex(parse(latex)) == written


@pytest.mark.parametrize(
    ("latex", "shown"),
    [(r"\bm{r}", "𝒓"), (r"\boldsymbol{\omega}", "𝝎"), (r"\mathbf{R2}", "𝐑2"), (r"\bm{ab}", "ab")],
)
def test_bold_in_mathml(latex, shown):
    assert "".join(ElementTree.fromstring(symbol_mathml(latex)).itertext()) == shown


def test_matplotlib_draws_signs_or_the_plain_name():
    pytest.importorskip("matplotlib")
    from lagcli.pictures.curves import _drawable

    assert _drawable(r"$\varphi_{1}$")
    assert not _drawable(r"$\bm{r}$")
