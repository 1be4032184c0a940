"""Texts of the models that are not shipped: chains of N bodies, and a pendulum of N links."""

from __future__ import annotations


def chain(n: int, stiffness: float | None = None, damping: float | None = None) -> str:
    """Return the model of a chain of point masses, released as a horizontal line.

    With a stiffness, every second link is a spring with a damper instead of a rod.
    """
    stiff = stiffness is not None
    springs = [i for i in range(1, n + 1) if stiff and i % 2 == 0]
    rods = [i for i in range(1, n + 1) if i not in springs]
    both = range(1, n + 1)

    def link(i: int) -> str:
        return "x_1^2 + y_1^2" if i == 1 else f"(x_{i} - x_{i - 1})^2 + (y_{i} - y_{i - 1})^2"

    lines = [
        f"name: {'stiff_' if stiff else ''}chain_{n}",
        f"coordinates: [{', '.join(f'x_{i}, y_{i}' for i in both)}]",
        "parameters:",
        "  m: 1 kg",
        "  g: 9.81 m/s^2",
        "  l: 1 m",
    ]
    if stiff:
        lines += [f"  k: {stiffness!r} N/m", f"  c: {damping!r} N*s/m", "definitions:"]
        lines += [f"  s_{i}: sqrt({link(i)})" for i in springs]
    lines += [
        f"T: m/2*({' + '.join(f'x_{i}^2 + y_{i}^2' for i in both)})".replace("^2", "'^2"),
        "V: >-",
        f"  m*g*({' + '.join(f'y_{i}' for i in both)})",
        *(f"  + k/2*(s_{i} - l)^2" for i in springs),
    ]
    if stiff:
        lines += ["D: >-", "  c/2*(" + " + ".join(f"s_{i}'^2" for i in springs) + ")"]
    lines += ["constraints:", *(f"  rod_{i}: {link(i)} = l^2" for i in rods), "initial:"]
    for i in both:
        lines += [f"  x_{i}: {i}*l", f"  y_{i}: 0 m", f"  x_{i}': 0 m/s", f"  y_{i}': 0 m/s"]
    return "\n".join(lines) + "\n"


def pendulum_of_links(n: int) -> str:
    """Return the model of n point masses on n rods, in the angles of the rods."""
    both = range(1, n + 1)
    lines = [
        f"name: pendulum_of_{n}_links",
        f"coordinates: [{', '.join(f'q_{i}' for i in both)}]",
        "parameters: {g: 9.81 m/s^2, " + ", ".join(f"m_{i}: 1 kg, l_{i}: 1 m" for i in both) + "}",
        "definitions:",
    ]
    for i in both:
        before_x, before_y = (f"x_{i - 1} + ", f"y_{i - 1} - ") if i > 1 else ("", "-")
        lines += [
            f"  x_{i}: {before_x}l_{i}*sin(q_{i})",
            f"  y_{i}: {before_y}l_{i}*cos(q_{i})",
        ]
    lines += [
        "T: " + " + ".join(f"m_{i}/2*(x_{i}'^2 + y_{i}'^2)" for i in both),
        "V: " + " + ".join(f"m_{i}*g*y_{i}" for i in both),
        "initial:",
    ]
    for i in both:
        lines += [f"  q_{i}: 0.1", f"  q_{i}': 0"]
    return "\n".join(lines) + "\n"
