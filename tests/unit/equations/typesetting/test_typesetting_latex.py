"""The derivation as LaTeX and Markdown: it parses, fits the page and survives any text."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest
from formula_values import MODELS, equations_of, model_of, pages_of, steps_of
from pylatexenc.latexwalker import (
    LatexCharsNode,
    LatexEnvironmentNode,
    LatexGroupNode,
    LatexMacroNode,
    LatexMathNode,
    LatexWalker,
)
from shipped import PATHS, WRITTEN, every_model

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import render
from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.latex import (
    TEXT_WIDTH,
    LatexFormula,
    escape,
    measure,
    render_latex,
)
from lagcli.equations.typesetting.markdown import render_markdown
from lagcli.equations.typesetting.mathml import MathmlFormula
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.writer import Break, written_decimals
from lagcli.model.loader import load_text

ENVIRONMENTS = {"document", "align", "itemize", "pmatrix", "cases", "aligned", "flushleft"}
MACROS = set(  # as a text, for a list of quoted words is harder to read
    r"""
    documentclass usepackage setlength textwidth oddsidemargin textheight topmargin
    allowdisplaybreaks section subsection noindent textit item notag label colon S
    frac tfrac sqrt dot ddot partial delta lambda pi sum textstyle left right bigl bigr biggl
    biggr lvert rvert lVert rVert lfloor rfloor lceil rceil mathit mathrm mathcal mathsf text
    operatorname sin cos tan sinh cosh tanh arcsin arccos arctan log min max exp le ge ne cdot
    times quad qquad _ $ & % # { } , \ textbackslash textasciicircum textasciitilde textless
    textgreater textbar textquotedbl circ to surd infty dots perp boldsymbol
    alpha beta gamma varepsilon zeta eta theta iota kappa mu nu xi rho sigma tau upsilon varphi
    chi psi omega vartheta Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega
    """.split()  # noqa: SIM905
)


def check(latex: str) -> None:
    """Parse strictly; every macro and environment must be known."""
    nodes, _, _ = LatexWalker(latex, tolerant_parsing=False).get_latex_nodes()
    stack = list(nodes)
    while stack:
        node = stack.pop()
        if isinstance(node, LatexMacroNode):
            assert node.macroname in MACROS, node.macroname
            stack += [n for n in (node.nodeargd.argnlist if node.nodeargd else []) if n]
        elif isinstance(node, LatexEnvironmentNode):
            assert node.environmentname in ENVIRONMENTS, node.environmentname
            stack += node.nodelist
        elif isinstance(node, LatexGroupNode | LatexMathNode):
            stack += node.nodelist
        elif isinstance(node, LatexCharsNode):
            # what stands outside of macros is what pdflatex has fonts for
            assert all(c.isascii() or "À" <= c <= "ſ" for c in node.chars), node.chars
    for opening, closing in (("{", "}"), (r"\bigl", r"\bigr"), (r"\biggl", r"\biggr")):
        bare = latex.replace(r"\{", "").replace(r"\}", "")
        assert bare.count(opening) == bare.count(closing)


def display_rows(latex: str) -> list[str]:
    blocks = re.findall(r"\\begin\{align\}(.*?)\\end\{align\}", latex, re.DOTALL)
    blocks = [re.sub(r" ?\\notag|\\label\{[^}]*\}", "", block) for block in blocks]
    # matrices and cases have their own rows
    inner = re.compile(r"\\begin\{(pmatrix|cases)\}.*?\\end\{\1\}", re.DOTALL)
    return [
        row.strip()
        for block in blocks
        for row in re.split(r"\\\\(?:\[1ex\])?\n", inner.sub("", block))
    ]


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_shipped_models(name):
    path = PATHS[name]
    model = equations_of(path).model
    formula = LatexFormula(Notation(model), written_decimals(model))
    for steps in (False, True):
        latex = render_latex(model, steps_of(path, steps), formula, numbered=steps, fragment=False)
        check(latex)
        rows = display_rows(latex)
        assert rows
        for row in rows:
            assert row
            assert measure(row.replace("&", "")) <= TEXT_WIDTH + 25, row


def test_textbook_lines():
    equations = equations_of(next(p for p in MODELS if p.stem == "slider_crank_textbook"))
    latex = render(equations, "latex", steps=True)
    assert (
        r"m r^{2} \, \bigl[\ddot{\varphi} + (\ddot{\varphi} + \ddot{\psi}) \sin^{2} \varphi"
        r" + (\dot{\varphi}^{2} - \dot{\psi}^{2}) \sin \varphi \cos \varphi\bigr]"
        r" + m g r \cos \varphi = \lambda \, r \cos \varphi"
    ) in latex
    assert r"r \cos \varphi \, \delta \varphi - l \cos \psi \, \delta \psi = 0" in latex
    assert r"\frac{d}{dt} \biggl(\frac{\partial L}{\partial \dot{\psi}}\biggr)" in latex


def test_fragment_and_document():
    equations = equations_of(MODELS[0])
    document, body = (render(equations, "latex", fragment=f) for f in (False, True))
    assert document.startswith(r"\documentclass")
    assert r"\begin{document}" not in body
    assert body in document


HOSTILE = r"""
name: '50% of $x_1 & #{y} \input{secret} ~^'
description: "Ünïcode 曲柄 φ ≤ 90°, <b>, a_b, {brace, \\end{document}, 'quotes' \"double\" |x|"
coordinates:
  x_1: {latex: '\vartheta_{1}', description: "the % of \\x"}
  wörd: {latex: '\broken{'}
  曲: {latex: '\input{/secret}'}
parameters: {m: 1, long_name_here: 2, S_1_2: 3}
T: m/2*(x_1'^2 + wörd'^2 + 曲'^2)
V: long_name_here*x_1^2 + S_1_2*wörd*曲
constraints:
  the_rod_2: {expr: x_1 = 曲, description: "100% _"}
  b: x_1*wörd' = 曲'
initial: {x_1: 0, x_1': 0, wörd: 0, wörd': 0, 曲: 0, 曲': 0}
"""


def test_hostile_names_and_descriptions():
    equations = derive(load_text(HOSTILE))
    for steps in (False, True):
        latex = render(equations, "latex", steps)
        check(latex)
        assert "secret" in latex
        assert r"\input" not in latex
        assert latex.count(r"\end{document}") == 1
        assert r"\ddot{\vartheta_{1}}" in latex
        assert r"\broken" not in latex
        assert r"\lambda_{\mathrm{the,rod,2}}" in latex
        markdown = render(equations, "markdown", steps)
        assert "<b>" not in markdown.replace(r"\<b\>", "")
        assert r"50% of \$x\_1" in markdown


@pytest.mark.parametrize("char", list('\\{}$&#%_^~<>|"−·×°²√–—…曲φΩé\u00a0'))
def test_every_sign_is_escaped(char):
    check(f"a{escape(char)}b")


@pytest.mark.parametrize(
    ("node", "shown"),
    [
        (t.Root(t.Symbol("x"), 3), r"\sqrt[3]{x}"),
        (t.Call("abs", (t.Symbol("x"),)), r"\lvert x \rvert"),
        (
            t.Call("abs", (t.Product((t.Symbol("m"), t.Call("abs", (t.Symbol("x"),)))),)),
            r"\bigl\lvert m \lvert x \rvert \bigr\rvert",
        ),
        (t.Call("atan2", (t.Symbol("y"), t.Symbol("x"))), r"\operatorname{atan2}(y, x)"),
        (t.Call("exp", (t.Sum(((-1, t.Symbol("x")),)),)), r"\mathrm{e}^{-x}"),
        (
            t.Cases(t.Relation(t.Symbol("x"), ">=", t.ONE), t.Symbol("y"), t.ZERO),
            r"\begin{cases} y & \text{if } x \ge 1 \\ 0 & \text{else} \end{cases}",
        ),
        (t.Power(t.Call("sin", (t.Symbol("phi"),)), t.whole(2)), r"\sin^{2} \varphi"),
        (t.Power(t.Quotient(t.ONE, t.Symbol("x")), t.whole(2)), r"\biggl(\frac{1}{x}\biggr)^{2}"),
        (t.Vector((t.Symbol("x"), t.ZERO)), r"\begin{pmatrix} x \\ 0 \end{pmatrix}"),
        (t.VirtualDisplacement(t.Symbol("delta")), r"\boldsymbol{\delta} \delta"),
    ],
)
def test_nodes(node, shown):
    formula = LatexFormula(Notation(model_of("x y phi delta", "m/2*x'^2").model))
    assert formula.latex(node) == shown
    check(shown)


CASES = t.Cases(t.Relation(t.Symbol("x"), "<", t.ONE), t.Symbol("y"), t.ZERO)
#: The last column of cases has no bracket of its own: what follows would belong to it.
_CASES = r"\begin{cases} y & \text{if } x < 1 \\ 0 & \text{else} \end{cases}"
_FENCED = rf"\biggl({_CASES}\biggr)"


@pytest.mark.parametrize(
    ("node", "shown"),
    [
        (t.Product((CASES, t.Symbol("x"))), rf"{_FENCED} \, x"),
        (t.Product((t.Symbol("x"), CASES)), rf"x {_CASES}"),
        (t.Sum(((1, CASES), (-1, t.Symbol("x")))), f"{_FENCED} - x"),
        (t.Sum(((1, t.Product((t.Symbol("x"), CASES))), (1, CASES))), rf"x {_FENCED} + {_CASES}"),
        (t.Sum(((1, t.Symbol("x")), (1, CASES))), f"x + {_CASES}"),
        (t.Relation(CASES, "<", t.Symbol("x")), f"{_FENCED} < x"),
    ],
)
def test_cases_that_something_follows_are_in_brackets(node, shown):
    names = Notation(model_of("x y", "m/2*x'^2").model)
    assert LatexFormula(names).latex(node).replace(r" \, \biggl", r" \biggl") == shown
    mathml = MathmlFormula(names).mathml(node)
    assert mathml.count("</mtable>") == shown.count("cases}") / 2
    assert mathml.count(">)</mo>") == shown.count(r"\biggr")


def test_measured_widths_are_near_those_of_tex():
    # \settowidth at 11 pt with amsmath
    for latex, points in MEASURED.items():
        assert 0.99 * points <= measure(latex) <= 1.15 * points  # rather too wide than too narrow


MEASURED = {
    r"m r^{2} \sin \varphi \cos \varphi \, (\dot{\varphi} + \dot{\psi})^{2}"
    r" - m g r \cos \varphi": 171.8,
    r"\frac{k}{\mathit{spring}} \, (\mathit{spring} - l_{0}) \, \bigl[(x_{b} s_{c} + y_{b} s_{d}"
    r" - x_{c} s_{c} - y_{c} s_{d}) \cos \gamma": 252.7,
    r"\tfrac{1}{2} m_{1} \dot{x}_{1}^{2} + \sqrt{x_{l}^{2} + y_{l}^{2}}"
    r" = \lambda_{\mathrm{guide}} \, r": 139.6,
    r"0.9375 e_{0}^{2} + 1.875 e_{1}^{2} + \frac{d}{dt} \biggl("
    r"\frac{\partial L}{\partial \dot{\psi}}\biggr) = 0": 166.4,
}


@pytest.mark.parametrize("path", MODELS[1::3], ids=lambda p: p.stem)
def test_markdown(path):
    model = equations_of(path).model
    formula = LatexFormula(Notation(model), written_decimals(model))
    text = render_markdown(model, steps_of(path, derivation=True), formula, numbered=True)
    assert text.startswith("# ")
    assert text.count("$$") % 2 == 0
    for block in re.findall(r"\$\$\n(.*?)\n\$\$", text, re.DOTALL):
        assert block.startswith(r"\begin{aligned}")
        assert block.endswith(r"\end{aligned}")
        assert "\n\n" not in block
        check(block)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs pdflatex")
@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_pdflatex_sets_every_page_of_every_shipped_model(path, tmp_path):
    """No error, no overfull box, no label twice: derivation, second kind, Maggi, closed forms."""
    model = equations_of(path).model
    formula = LatexFormula(Notation(model), written_decimals(model))
    for i, steps in enumerate(pages_of(path)):
        latex = render_latex(model, steps, formula, numbered=True, fragment=False)
        (tmp_path / f"{i}.tex").write_text(latex)
        subprocess.run(
            ["pdflatex", "-interaction=batchmode", "-halt-on-error", f"{i}.tex"],
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            check=True,
        )
        log = (tmp_path / f"{i}.log").read_text(encoding="latin-1")
        for fault in ("Overfull", "multiply defined", "Missing character", "undefined"):
            assert fault not in log, (path.stem, log)


def test_wide_fractions_and_roots_can_be_broken():
    formula = LatexFormula(Notation(model_of("x y", "m/2*x'^2").model))
    long = t.sum_of([(1, t.Product((t.Symbol("x"), t.Symbol("y"), t.whole(k)))) for k in range(20)])
    over, under = (t.quotient_of(*x) for x in ((long, t.Symbol("m")), (t.Symbol("m"), long)))
    assert formula.latex(over).startswith(r"\frac{1}{m} \, (x y 0 + x y 1")
    assert formula.latex(under).startswith("m/(x y 0 + x y 1")
    assert formula.latex(t.Root(long)).endswith(")^{1/2}")
    for node in (over, under, t.Root(long)):
        assert sum(isinstance(x, Break) for x in formula.tokens(node)) > 10


def test_equations_are_numbered_and_labelled_once():
    for steps in (False, True):
        latex = render(
            equations_of(next(p for p in MODELS if p.stem == "four_bar")), "latex", steps
        )
        labels = re.findall(r"\\label\{(.*?)\}", latex)
        assert len(set(labels)) == len(labels)
        assert {"eq:equations-of-motion-theta-1", "eq:constraints-joint-x"} <= set(labels)
        assert "align*" not in latex


def test_remarks_with_dots_and_letters_of_the_theory():
    assert escape("∂ψ/∂q̇") == r"$\partial$$\psi$/$\partial$$\dot{q}$"
    assert escape("φ̈") == r"$\ddot{\varphi}$"
    assert escape("Mass matrix ℳ") == r"Mass matrix $\mathcal{M}$"


def test_conditions_of_contact_are_numbered_displays():
    """Inequalities are no items of a list, beside equations that are displayed."""
    latex = render(equations_of(next(p for p in MODELS if p.stem == "woodpecker")), "latex")
    assert latex.count("itemize") == 2, "of the coordinates alone"
    contact = latex.split("Contact and friction")[1].split("Degrees of freedom")[0]
    assert r"0 \le \lambda_{\mathrm{upper}} \perp" in contact
    assert contact.count(r"\begin{align}") == contact.count(r"\end{align}") == 6


@pytest.mark.parametrize("form", ["latex", "markdown"])
def test_sticking_and_slipping_are_named_at_their_equations(form):
    text = render(equations_of(next(p for p in MODELS if p.stem == "stick_slip_belt")), form)
    (sticks,) = re.findall(r".*text\{sticks\}.*", text)
    (slips,) = re.findall(r".*text\{slips\}.*", text)
    assert r"\le F_{s}" in sticks
    assert r"\operatorname{sign}" in slips
    assert "(sticks)" not in text
