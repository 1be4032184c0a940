"""The modes of a run's model, as sections of its report."""

from __future__ import annotations

from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.model.result_units import result_units
from lagcli.pictures.report.analysis_sections import AnalysisSection, content_sections


def modes_sections(model: Model, about: str) -> list[AnalysisSection]:
    """Return the sections of the modes about a point of a run.

    Parameters
    ----------
    model : Model
        Model with the values of the run.
    about : str
        ``start``, ``equilibrium`` or a time, s.

    Raises
    ------
    UsageError
        The point is invalid, or matplotlib is not installed.
    ModelError, NumericalError
        As `lagcli.modes`.
    """
    from lagcli.analysis.linear.description import describe_modes
    from lagcli.analysis.linear.modes import modes

    if about in ("start", "equilibrium"):
        found = modes(model, equilibrium=about == "equilibrium")
    else:
        try:
            found = modes(model, at=float(about))
        except ValueError:
            raise UsageError(
                f"--modes {about}: give start, equilibrium or a time of the run in s: --modes start"
            ) from None
    return content_sections(describe_modes(found), result_units(model))
