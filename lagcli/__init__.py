"""Lagrange's equations of the first kind from a model file.

>>> model = lagcli.load("models/slider_crank.yaml")
>>> equations = lagcli.derive(model)
>>> trajectory = lagcli.simulate(model, t_end=2.0)
>>> lagcli.write(trajectory, "run.h5")
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from lagcli.version import __version__

if TYPE_CHECKING:
    from lagcli.analysis.check.check import check
    from lagcli.analysis.compare.comparison import compare
    from lagcli.analysis.compare.two_models import compare_models
    from lagcli.analysis.equilibria.diagram import follow_equilibria
    from lagcli.analysis.equilibria.equilibrium import equilibrium
    from lagcli.analysis.fit.fit import fit
    from lagcli.analysis.linear.linear_model import linearize
    from lagcli.analysis.linear.modes import modes
    from lagcli.analysis.opening import open
    from lagcli.analysis.writing import write
    from lagcli.equations.derivation.lagrange import derive
    from lagcli.equations.render import render
    from lagcli.export.dynamics import dynamics
    from lagcli.export.fmu import fmu
    from lagcli.export.formats import code
    from lagcli.live.page import live_page
    from lagcli.model.loader import load, load_text
    from lagcli.pictures.animation.animate import animate
    from lagcli.pictures.plots.plot import plot
    from lagcli.pictures.report import report
    from lagcli.results import read
    from lagcli.simulations.partition import partition
    from lagcli.simulations.simulation import simulate
    from lagcli.simulations.start import degrees_of_freedom
    from lagcli.sweeps.run import sweep

__all__ = [
    "__version__",
    "animate",
    "check",
    "code",
    "compare",
    "compare_models",
    "degrees_of_freedom",
    "derive",
    "dynamics",
    "equilibrium",
    "fit",
    "fmu",
    "follow_equilibria",
    "linearize",
    "live_page",
    "load",
    "load_text",
    "modes",
    "open",
    "partition",
    "plot",
    "read",
    "render",
    "report",
    "simulate",
    "sweep",
    "write",
]

# imported on first access, so that a command does not import modules that it does not use
_PLACES = {
    "animate": "lagcli.pictures.animation.animate",
    "check": "lagcli.analysis.check.check",
    "code": "lagcli.export.formats",
    "compare": "lagcli.analysis.compare.comparison",
    "compare_models": "lagcli.analysis.compare.two_models",
    "degrees_of_freedom": "lagcli.simulations.start",
    "derive": "lagcli.equations.derivation.lagrange",
    "dynamics": "lagcli.export.dynamics",
    "equilibrium": "lagcli.analysis.equilibria.equilibrium",
    "fmu": "lagcli.export.fmu",
    "live_page": "lagcli.live.page",
    "follow_equilibria": "lagcli.analysis.equilibria.diagram",
    "linearize": "lagcli.analysis.linear.linear_model",
    "fit": "lagcli.analysis.fit.fit",
    "load": "lagcli.model.loader",
    "load_text": "lagcli.model.loader",
    "modes": "lagcli.analysis.linear.modes",
    "open": "lagcli.analysis.opening",
    "partition": "lagcli.simulations.partition",
    "plot": "lagcli.pictures.plots.plot",
    "read": "lagcli.results",
    "render": "lagcli.equations.render",
    "report": "lagcli.pictures.report",
    "simulate": "lagcli.simulations.simulation",
    "sweep": "lagcli.sweeps.run",
    "write": "lagcli.analysis.writing",
}


def __dir__() -> list[str]:
    return sorted(__all__)


if "IPython" in sys.modules:  # in a notebook: rich display of models, equations and runs
    from lagcli.pictures.report.notebook import register

    register()


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_PLACES[name]), name)
    globals()[name] = value
    return value
