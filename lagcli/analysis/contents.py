"""Contents of analysis files as text and as sections, by the command that wrote them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, NamedTuple

from lagcli.analysis.output.tables import ResultSection
from lagcli.results.metadata import model_title


class _Outputs(NamedTuple):
    """Functions that convert a content: to text, and to sections with units."""

    text: Callable[[Mapping[str, Any]], str]
    sections: Callable[[Mapping[str, Any], Mapping[str, str]], list[ResultSection]]


def format_content(content: Mapping[str, Any]) -> str:
    """Return the text that the command prints for a content."""
    return _outputs(content).text(content)


def content_sections(content: Mapping[str, Any], units: Mapping[str, str]) -> list[ResultSection]:
    """Return the sections of a content.

    Parameters
    ----------
    content : mapping
        Content printed by ``--json``.
    units : mapping of str to str
        Units of coordinates, and of λ by column.
    """
    return _outputs(content).sections(content, units)


def result_sections(result: object) -> list[ResultSection]:
    """Return the sections of an analysis' result of the Python interface, in SI.

    Parameters
    ----------
    result : LinearModel, ModalAnalysis, Equilibria, BifurcationDiagram, FormulationComparison, \
            ModelComparison or FitResult
    """
    from lagcli.analysis.compare.comparison import FormulationComparison
    from lagcli.analysis.compare.description import describe_comparison, describe_models
    from lagcli.analysis.compare.two_models import ModelComparison
    from lagcli.analysis.equilibria.description import describe_diagram, describe_equilibria
    from lagcli.analysis.equilibria.diagram import BifurcationDiagram
    from lagcli.analysis.equilibria.equilibrium import Equilibria
    from lagcli.analysis.fit.result import FitResult, fit_sections
    from lagcli.analysis.linear.description import describe_linear, describe_modes
    from lagcli.analysis.linear.linear_model import LinearModel
    from lagcli.analysis.linear.modes import ModalAnalysis

    match result:
        case FitResult():
            return fit_sections(result)
        case LinearModel():
            return content_sections(describe_linear(result), {})
        case ModalAnalysis():
            return content_sections(describe_modes(result), {})
        case Equilibria():
            return content_sections(describe_equilibria(result), {})
        case BifurcationDiagram():
            return content_sections(describe_diagram(result), {})
        case FormulationComparison():
            return content_sections(describe_comparison(result), {})
        case ModelComparison():
            titles = (model_title(x.model) or "" for x in (result.first, result.second))
            return content_sections(describe_models(result, *titles), result.first.units)
    raise TypeError(f"there are no sections of {type(result).__name__}")


def _outputs(content: Mapping[str, Any]) -> _Outputs:
    match content["command"]:
        case "compare":
            from lagcli.analysis.compare import description as compare

            return _Outputs(compare.format_comparison, compare.sections)
        case "linearize":
            from lagcli.analysis.linear import description as linear

            return _Outputs(linear.format_linear, linear.linear_sections)
        case "modes":
            from lagcli.analysis.linear import description as linear

            return _Outputs(linear.format_modes, linear.modes_sections)
        case "equilibrium":
            from lagcli.analysis.equilibria import description as equilibria

            if "branches" in content:
                return _Outputs(equilibria.format_diagram, equilibria.diagram_sections)
            return _Outputs(equilibria.format_equilibria, equilibria.equilibria_sections)
    analysis = import_module(f"lagcli.analysis.{content['command']}")
    return _Outputs(analysis.format_content, analysis.sections)
