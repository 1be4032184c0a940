"""Draw the first picture of the documentation: a model, its equations, and its motion with λ(t).

``python docs/first_picture.py`` derives and simulates the model below and writes
``docs/first_picture.svg``. T, V and the constraint have one colour each, in the file, in the
equations, and, for the constraint, in the drawing and in the curve.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from html import escape
from pathlib import Path

import numpy as np

import lagcli

PICTURE = Path(__file__).with_name("first_picture.svg")
MODEL = """coordinates: [phi, psi]
parameters: {m: 1 kg, r: 0.1 m, l: 0.3 m, g: 9.81 m/s^2}
definitions:
  x_A: r*cos(phi)
  y_A: r*sin(phi)
  x_B: r*cos(phi) + l*cos(psi)
  y_B: r*sin(phi) - l*sin(psi)
T: m/2*(x_A'^2 + y_A'^2) + m/2*(x_B'^2 + y_B'^2)
V: m*g*(y_A + y_B)
constraints:
  guide: r*sin(phi) = l*sin(psi)
initial: {phi: 0.5, phi': 12, psi: {guess: 0.1}, psi': {guess: 0}}
"""
WIDTH, HEIGHT = 960, 444
#: Line height and width of letters, pixels.
LINE, LETTER = 19, 7.4
#: Of the drawing: pixels per metre, pixels per newton, and the place of O.
METRE, NEWTON, ORIGIN = 700, 5, (645, 124)
#: Of the curve: left, right, and the places of 0 N and 15 N.
LEFT, RIGHT, ZERO, TOP = 588, 936, 300, 222
#: Frames of one turn, and its duration on the screen, s.
FRAMES, SECONDS = 72, 4
CRANK, ROD = 0.1, 0.3

STYLE = """
.paper{fill:#fff}.frame{fill:#f6f7f9}text{font:12.5px ui-monospace,"DejaVu Sans Mono",Menlo,
Consolas,monospace;fill:#24292f;white-space:pre}.head{font:600 12px system-ui,sans-serif;
fill:#57606a}.small{font-size:11px;fill:#57606a}.T{fill:#0062a3}.V{fill:#00714f}.C{fill:#b34700;font-weight:600}.rod{stroke:#404040;stroke-width:5;
stroke-linecap:round}.ground{stroke:#767676;stroke-width:1.2;fill:none}.mass{fill:#202020}
.block{fill:#d0d4d9;stroke:#404040;stroke-width:1.5}.force{stroke:#d55e00;stroke-width:2.6;
fill:none}.tip{fill:#d55e00}.axis{stroke:#8c959f;stroke-width:1}.still{display:none}
@media (prefers-color-scheme:dark){.paper{fill:#16191d}.frame{fill:#1f242a}text{fill:#e6e8ea}
.head,.small{fill:#a8b0b8}.T{fill:#6cbcf0}.V{fill:#3fd0a4}.C{fill:#ff9a55}.rod{stroke:#c8ccd0}
.mass{fill:#f0f0f0}.block{fill:#4a525b;stroke:#c8ccd0}}
@media (prefers-reduced-motion:reduce){.still{display:inline}.moving{display:none}}
"""


def line(x: float, y: float, parts: Iterable[tuple[str, str]]) -> str:
    """Return a line of text; parts are pairs of a class and a text.

    All letters have one width. Dots above letters are drawn, because fonts place them differently.
    """
    inside, dots, count = "", "", 0
    for name, text in parts:
        letters = ""
        for letter in text:
            if unicodedata.combining(letter):
                middle = x + LETTER * (count - 0.5)
                offsets = (0.0,) if letter == "\u0307" else (-2.0, 2.0)
                dots += "".join(
                    f'<circle class="{name}" cx="{middle + dx:g}" cy="{y - 10.5:g}" r="1.1"/>'
                    for dx in offsets
                )
            else:
                letters, count = letters + letter, count + 1
        inside += f'<tspan class="{name}">{escape(letters)}</tspan>' if name else escape(letters)
    return (
        f'<text x="{x:g}" y="{y:g}" textLength="{LETTER * count:g}"'
        f' lengthAdjust="spacingAndGlyphs">{inside}</text>{dots}'
    )


def yaml_parts(text: str) -> list[tuple[str, str]]:
    """Return a line of the model, with the colour of T, V or the constraint."""
    name = {"T:": "T", "V:": "V", "  guide:": "C"}
    return [(next((c for key, c in name.items() if text.startswith(key)), ""), text)]


def equation_parts(text: str) -> list[tuple[str, str]]:
    """Return an equation, its terms in the colours of what they come from."""
    label, text = text.split(":  ")
    left, right = text.split(" = ")
    weight = re.search(r" [+−] [^+−(\[]*\bg\b[^+−]*$", left)
    assert weight is not None
    inertia, weight_text = left[: weight.start()], left[weight.start() :]
    return [
        ("", f"{label}:  "),
        ("T", inertia),
        ("V", weight_text),
        ("", " = "),
        ("C", right),
    ]


def equations(text: str) -> list[str]:
    """Return the equations of motion of a derivation, one line each."""
    block = text.split("Equations of motion\n")[1].split("\n\n")[0]
    return [x.strip() for x in re.sub(r"\n {6,}", " ", block).splitlines()]


def turn(model: lagcli.Model) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return φ, ψ and λ during one turn of the crank, and its duration, s."""
    run = lagcli.simulate(model, t_end=1, samples=4001)
    phi, psi = run.q.T
    period = float(np.interp(phi[0] + 2 * np.pi, phi, run.time))
    times = np.linspace(0, period, FRAMES + 1)
    columns = (phi, psi, run.multipliers[:, 0])
    return *(np.interp(times, run.time, x) for x in columns), period


def animate(name: str, values: Iterable[float]) -> str:
    """Return the element that moves an attribute."""
    listed = ";".join(f"{x:.1f}".removesuffix(".0") for x in values)
    return (
        f'<animate attributeName="{name}" dur="{SECONDS}s" repeatCount="indefinite"'
        f' values="{listed}"/>'
    )


def shape(tag: str, name: str, moving: bool, fixed: str = "", **values: np.ndarray) -> str:
    """Return a shape whose attributes have a value for each frame."""
    first = " ".join(f'{key}="{x[0]:.1f}"' for key, x in values.items())
    inside = "".join(animate(key, x) for key, x in values.items()) if moving else ""
    return f'<{tag} class="{name}" {fixed} {first}>{inside}</{tag}>'


def mechanism(phi: np.ndarray, psi: np.ndarray, force: np.ndarray, moving: bool) -> str:
    """Return the mechanism and the marks on the curve."""
    x, y = ORIGIN[0] + METRE * CRANK * np.cos(phi), ORIGIN[1] - METRE * CRANK * np.sin(phi)
    slider = x + METRE * ROD * np.cos(psi)
    level = np.full_like(slider, float(ORIGIN[1]))
    tip = level - NEWTON * force
    at, value = np.linspace(LEFT, RIGHT, len(phi)), of_force(force)
    centre = {"x1": np.full_like(x, float(ORIGIN[0])), "y1": level}
    return "".join(
        [
            shape("rect", "block", moving, 'width="34" height="20"', x=slider - 17, y=level - 10),
            shape("line", "rod", moving, x1=x, y1=y, x2=slider, y2=level),
            shape("line", "rod", moving, **centre, x2=x, y2=y),
            shape("circle", "mass", moving, 'r="7"', cx=x, cy=y),
            shape("circle", "mass", moving, 'r="7"', cx=slider, cy=level),
            shape("line", "force", moving, x1=slider, y1=level, x2=slider, y2=tip),
            head(slider, tip, moving),
            shape("line", "axis", moving, f'y1="{TOP}" y2="{ZERO}"', x1=at, x2=at),
            shape("circle", "tip", moving, 'r="4.5"', cx=at, cy=value),
        ]
    )


def head(x: np.ndarray, y: np.ndarray, moving: bool) -> str:
    """Return the tip of the arrow."""
    places = ";".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    follow = (
        f'<animateTransform attributeName="transform" type="translate" dur="{SECONDS}s"'
        f' repeatCount="indefinite" values="{places}"/>'
    )
    first = places.partition(";")[0]
    return (
        f'<path class="tip" d="M0-9L6 4H-6Z" transform="translate({first})">'
        f"{follow if moving else ''}</path>"
    )


def of_force(force: np.ndarray) -> np.ndarray:
    """Return the heights of forces in the curve."""
    return ZERO + (TOP - ZERO) * force / 15


def curve(force: np.ndarray, period: float) -> str:
    """Return λ over the time of one turn."""
    at = np.linspace(LEFT, RIGHT, len(force))
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(at, of_force(force), strict=True))
    ticks = "".join(
        f'<text class="small" text-anchor="end" x="{LEFT - 6}" y="{of_force(x) + 4:g}">{x}</text>'
        for x in (0, 5, 10, 15)
    )
    return (
        f'<path class="axis" fill="none" d="M{LEFT} {TOP}V{ZERO}H{RIGHT}"/>{ticks}'
        f'<polyline class="force" points="{places}"/>'
        f'<text class="C" x="{LEFT + 8}" y="{TOP + 2}">λ(t) [N], the force of the guide</text>'
        f'<text class="small" text-anchor="end" x="{RIGHT}" y="{ZERO + 15}">'
        f"t = {period:.3f} s, one turn</text>"
    )


def ground() -> str:
    """Return the support of the crank and the guide."""
    x, y = ORIGIN
    hatch = "".join(f"M{x - 12 + 6 * i} {y + 14}l-5 5" for i in range(5))
    return (
        f'<path class="ground" d="M{x} {y}l-9 14h18ZM{x - 15} {y + 14}h30{hatch}"/>'
        f'<path class="ground" stroke-dasharray="9 4 2 4" d="M{x + 120} {y}H{x + 296}"/>'
        f'<text x="{x - 20}" y="{y - 6}">O</text>'
    )


def picture() -> str:
    """Return the picture as SVG."""
    model = lagcli.load_text(MODEL)
    phi, psi, force, period = turn(model)
    text = unicodedata.normalize("NFD", lagcli.render(lagcli.derive(model)))
    derived = equations(text)
    listing = [line(36, 64 + LINE * i, yaml_parts(x)) for i, x in enumerate(MODEL.splitlines())]
    below = ZERO + 54
    formulas = [line(36, below + 27 * (i + 1), equation_parts(x)) for i, x in enumerate(derived)]
    about = (
        "Three parts in the same colours: a model file of twelve lines, Lagrange's equations of"
        " the first kind that follow from it, and the moving slider-crank with the force of its"
        " guide, the multiplier λ over the time."
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">',
            f"<title>From twelve lines to the motion and its λ</title><desc>{about}</desc>",
            f"<style>{STYLE}</style>",
            f'<rect class="paper" width="{WIDTH}" height="{HEIGHT}" rx="8"/>',
            f'<rect class="frame" x="16" y="16" width="528" height="{below - 50}" rx="6"/>',
            f'<rect class="frame" x="16" y="{below - 24}" width="928" height="98" rx="6"/>',
            '<text class="head" x="36" y="40">What you write</text>',
            '<text class="head" x="564" y="40">What moves, and which force it takes</text>',
            f'<text class="head" x="36" y="{below}">What follows</text>',
            *listing,
            *formulas,
            ground(),
            curve(force, period),
            f'<g class="moving">{mechanism(phi, psi, force, True)}</g>',
            f'<g class="still">{mechanism(phi, psi, force, False)}</g>',
            "</svg>",
            "",
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
