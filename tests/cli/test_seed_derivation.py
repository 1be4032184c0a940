"""The derivation of the textbook's worked example, line by line as the textbook writes it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lagcli.cli.app import run
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import render
from lagcli.model.loader import load
from lagcli.simulations.partition import partition

ROOT = Path(__file__).parents[2]
GOLDEN = Path(__file__).parent / "golden" / "derive"

# (8.88) to the end, without the two misprints: the second term of T has ẋ_B, and the assembled
# equation of φ has φ̇² − ψ̇²
FIRST_KIND = """\
x_A = r cos φ
y_A = r sin φ
x_B = r cos φ + l cos ψ
r sin φ = l sin ψ
T = ½ m [r² φ̇² + r² sin² φ (φ̇ + ψ̇)²]
V = m g y_A = m g r sin φ
L = T − V = ½ m [r² φ̇² + r² sin² φ (φ̇ + ψ̇)²] − m g r sin φ
r φ̇ cos φ = l ψ̇ cos ψ
∂L/∂φ = m r² sin φ cos φ (φ̇ + ψ̇)² − m g r cos φ
∂L/∂ψ = 0
∂L/∂φ̇ = m r² [φ̇ + (φ̇ + ψ̇) sin² φ]
∂L/∂ψ̇ = m r² (φ̇ + ψ̇) sin² φ
d/dt ∂L/∂φ̇ = m r² [φ̈ + (φ̈ + ψ̈) sin² φ + 2 (φ̇ + ψ̇) φ̇ sin φ cos φ]
d/dt ∂L/∂ψ̇ = m r² [(φ̈ + ψ̈) sin² φ + 2 (φ̇ + ψ̇) φ̇ sin φ cos φ]
r cos φ δφ − l cos ψ δψ = 0
d/dt ∂L/∂φ̇ − ∂L/∂φ = λ r cos φ
d/dt ∂L/∂ψ̇ − ∂L/∂ψ = −λ l cos ψ
m r² [φ̈ + (φ̈ + ψ̈) sin² φ + (φ̇² − ψ̇²) sin φ cos φ] + m g r cos φ = λ r cos φ
m r² [(φ̈ + ψ̈) sin² φ + 2 (φ̇ + ψ̇) φ̇ sin φ cos φ] = −λ l cos ψ
"""

# What the textbook does first: ψ̇ solved and put into L, (8.89)
SECOND_KIND = """\
sin ψ = r sin(φ)/l
r (φ̈ cos φ − φ̇² sin φ) = l (ψ̈ cos ψ − ψ̇² sin ψ)
det b = −l cos ψ
ψ̇ = r φ̇ cos(φ)/(l cos ψ) = r φ̇ cos(φ)/√(l² − r² sin² φ)
L = T − V = ½ m [r² φ̇² + r² sin² φ (φ̇ + ψ̇)²] − m g r sin φ \
= ½ m {r² φ̇² + r² sin² φ [φ̇ + r φ̇ cos(φ)/√(l² − r² sin² φ)]²} − m g r sin φ
"""

# (8.87) and the energies, from the model that writes T and V without the constraint
ENERGIES = """\
x_A = r cos φ
y_A = r sin φ
x_B = r cos φ + l cos ψ
r sin φ = l sin ψ
ẋ_A = −r φ̇ sin φ
ẏ_A = r φ̇ cos φ
ẋ_B = −r φ̇ sin φ − l ψ̇ sin ψ
ẏ_B = r φ̇ cos φ − l ψ̇ cos ψ
T = ½ m (ẋ_A² + ẏ_A²) + ½ m (ẋ_B² + ẏ_B²) \
= ½ m [(r φ̇ sin φ)² + (r φ̇ cos φ)²] + ½ m [(r φ̇ sin φ + l ψ̇ sin ψ)² + (r φ̇ cos φ − l ψ̇ cos ψ)²] \
= m r² φ̇² + ½ m l² ψ̇² − m r l φ̇ ψ̇ cos(φ + ψ)
V = m g (y_A + y_B) = m g (2 r sin φ − l sin ψ)
L = T − V = m r² φ̇² + ½ m l² ψ̇² − m r l φ̇ ψ̇ cos(φ + ψ) − m g (2 r sin φ − l sin ψ)
"""


def equations(name: str):
    return derive(load(ROOT / "models" / f"{name}.yaml"))


def formulas(text: str) -> set[str]:
    """Return the formulas of a text, without labels, notes and the columns of alignment."""
    found = set()
    for line in text.splitlines():
        body = line.strip()
        head, colon, rest = body.partition(":  ")
        formula = re.split(r"   (?=[a-z]{3})", rest if colon and "=" not in head else body)[0]
        found.add(" ".join(formula.split()))
    return found


@pytest.mark.parametrize("line", FIRST_KIND.splitlines())
def test_the_first_kind(line):
    assert line in formulas(render(equations("slider_crank_textbook"), steps=True))


@pytest.mark.parametrize("line", ENERGIES.splitlines())
def test_coordinates_and_energies(line):
    assert line in formulas(render(equations("slider_crank"), steps=True, width=400))


def test_the_textbooks_numbers_are_cited():
    text = render(equations("slider_crank_textbook"), steps=True)
    assert "(textbook, §8, eq. 8.79)" in text
    assert "(8.86)" in text
    forced = render(equations("slider_crank"), steps=True)
    assert "(8.85), written with the Lagrangian" in forced
    assert "(8.86)" not in forced


@pytest.mark.parametrize("line", SECOND_KIND.splitlines())
def test_the_second_kind(line):
    e = equations("slider_crank_textbook")
    independent = partition(e, ["phi"])
    text = render(e, steps=True, kinds=("first", "second"), partition=independent, width=400)
    assert line in formulas(text)
    assert "(8.89)" in text


def test_the_steps_on_the_command_line_have_both_kinds(capsys):
    path = str(ROOT / "models" / "slider_crank_textbook.yaml")
    assert run(["derive", path, "--steps", "--width", "400"]) == 0
    assert set((FIRST_KIND + SECOND_KIND).splitlines()) <= formulas(capsys.readouterr().out)


CASES = [
    ("slider_crank_textbook", True, 100),
    ("slider_crank", True, 80),
    ("slider_crank_textbook", False, 100),
    ("andrews_squeezer", False, 100),
    ("rolling_disk", False, 80),
    ("car_axis", False, 80),
]


@pytest.mark.parametrize(
    ("name", "steps", "width"), CASES, ids=[f"{n}-{'steps' * s}{w}" for n, s, w in CASES]
)
def test_whole_pages(name, steps, width):
    path = GOLDEN / f"{name}{'.steps' if steps else ''}.txt"
    assert render(equations(name), steps=steps, width=width) == path.read_text(encoding="utf-8")
