"""A pendulum in Cartesian coordinates without symbols: its System, a request, and its motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from integration_requests import changed
from scipy.special import ellipj, ellipk

from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.system import State, System
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape
from lagcli.settings.settings import SettingsOverrides, resolve

G = 9.81


def pendulum(t: np.ndarray) -> np.ndarray:
    """Return x and y of the pendulum released at the horizontal."""
    sn, _, _, _ = ellipj(ellipk(0.5) - math.sqrt(9.81) * t, 0.5)
    theta = 2 * np.arcsin(math.sqrt(0.5) * sn)
    return np.column_stack([np.sin(theta), -np.cos(theta)])


def pendulum_system() -> System:
    """Return x² + y² = 1 in a uniform field, as operations on registers: t x y u v [a b λ] g."""
    one, two, zero = 6, 7, 8  # constants, after t x y u v g
    at = 9
    dynamics = Tape(
        6,
        (1.0, 2.0, 0.0),
        (
            (Op.NEG, at, 5, 0, 0),  # f_y = −g
            (Op.MUL, at + 1, two, 1, 0),  # 2 x
            (Op.MUL, at + 2, two, 2, 0),  # 2 y
            (Op.MUL, at + 3, 3, 3, 0),
            (Op.MUL, at + 4, 4, 4, 0),
            (Op.ADD, at + 5, at + 3, at + 4, 0),
            (Op.MUL, at + 6, two, at + 5, 0),
            (Op.NEG, at + 7, at + 6, 0, 0),  # γ = −2 (u² + v²)
        ),
        (one, one, zero, at, at + 1, at + 2, at + 7, zero),
    )
    constraint = Tape(
        6,
        (1.0, 2.0, 0.0),
        (
            (Op.MUL, at, 1, 1, 0),
            (Op.MUL, at + 1, 2, 2, 0),
            (Op.ADD, at + 2, at, at + 1, 0),
            (Op.SUB, at + 3, at + 2, one, 0),  # φ
            (Op.MUL, at + 4, two, 1, 0),
            (Op.MUL, at + 5, two, 2, 0),
            (Op.ADD, at + 6, at + 2, one, 0),  # scale of φ
            (Op.MUL, at + 7, at + 4, 3, 0),
            (Op.MUL, at + 8, at + 5, 4, 0),
            (Op.ABS, at + 9, at + 7, 0, 0),
            (Op.ABS, at + 10, at + 8, 0, 0),
            (Op.ADD, at + 11, at + 9, at + 10, 0),  # scale of ψ
        ),
        (at + 3, at + 4, at + 5, zero, at + 6, at + 11),
    )
    return System(
        coordinates=("x", "y"),
        constraints=("rod",),
        holonomic=(0,),
        parameters=("g",),
        mass_pattern=((0, 0), (1, 1)),
        jacobian_pattern=((0, 0), (0, 1)),
        dynamics=dynamics,
        constraint=constraint,
        report=Tape(9, (), (), ()),
    )


def request(atol: float = 1e-11, **changes: Any) -> IntegrationRequest:
    """Return a request for two seconds from rest at the horizontal."""
    base = IntegrationRequest(
        state=State(0.0, np.array([1.0, 0.0]), np.zeros(2), (G,)),
        rank=1,
        settings=resolve(SettingsOverrides(t_end=2.0, rtol=1e-10, method="DOP853")),
        times=np.linspace(0, 2, 21),
        atol=atol,
    )
    return changed(base, **changes)
