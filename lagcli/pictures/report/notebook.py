"""Rich display of models, equations and runs in notebooks."""

from __future__ import annotations

import base64
import html
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from lagcli.errors import LagcliError

if TYPE_CHECKING:
    from lagcli.equations.derivation.lagrange import Equations
    from lagcli.model.model import Model
    from lagcli.trajectory.trajectory import Trajectory


_HEIGHT = 560  # pixels of an animation
#: Results of analyses: their modules in `lagcli.analysis` and their types.
_RESULTS = (
    ("compare.comparison", "FormulationComparison"),
    ("equilibria.diagram", "BifurcationDiagram"),
    ("equilibria.equilibrium", "Equilibria"),
    ("fit.result", "FitResult"),
    ("linear.linear_model", "LinearModel"),
    ("linear.modes", "ModalAnalysis"),
)


def register() -> None:
    """Register the representations in the IPython session, if there is one.

    Types are registered by name, so that nothing is imported before it is displayed.
    """
    from IPython import get_ipython

    shell = get_ipython()
    if shell is None:
        return
    formatters = shell.display_formatter.formatters
    for format_, module, type_, function in (
        ("text/markdown", "lagcli.model.model", "Model", model_markdown),
        ("text/markdown", "lagcli.equations.derivation.lagrange", "Equations", equations_markdown),
        ("text/html", "lagcli.trajectory.trajectory", "Trajectory", trajectory_html),
        *(
            ("text/html", f"lagcli.analysis.{module}", type_, analysis_html)
            for module, type_ in _RESULTS
        ),
    ):
        formatters[format_].for_type_by_name(module, type_, function)


def model_markdown(model: Model) -> str:
    """Return the equations of a model, in Markdown with LaTeX."""
    from lagcli.equations.derivation.lagrange import derive

    return equations_markdown(derive(model))


def equations_markdown(equations: Equations) -> str:
    """Return equations in Markdown with LaTeX."""
    from lagcli.equations.render import render
    from lagcli.simulations.start import degrees_of_freedom

    return render(equations, format="markdown", freedom=degrees_of_freedom(equations))


def analysis_html(result: object) -> str:
    """Return the result of an analysis in HTML: the tables of its report, in SI."""
    from lagcli.analysis.contents import result_sections
    from lagcli.pictures.report.analysis_report import rendered

    sections = rendered(result_sections(result), None)
    return "\n".join(f"<h4>{html.escape(x.title)}</h4>{x.body}" for x in sections if x.body)


def trajectory_html(trajectory: Trajectory) -> str:
    """Return a run in HTML: its status, animation and plot."""
    from lagcli.pictures.page import with_code
    from lagcli.results.metadata import model_title

    name = model_title(trajectory.model) or "run"
    times = trajectory.time
    span = f", t = {times[0]:g} to {times[-1]:g} s, {len(times)} samples" if len(times) else ""
    message = f": {with_code(trajectory.message)}" if trajectory.message else ""
    title = f"<p><b>{html.escape(name)}</b>: {trajectory.status}{message}{span}</p>"
    return "\n".join([title, *(_picture(make, trajectory) for make in (_animation, _plot))])


def _picture(make: Any, trajectory: Trajectory) -> str:
    """Return a picture, or the reason why there is none."""
    with TemporaryDirectory() as folder:
        try:
            return str(make(trajectory, Path(folder)))
        except LagcliError as error:
            return f"<p>{html.escape(str(error))}</p>"


def _animation(trajectory: Trajectory, folder: Path) -> str:
    from lagcli.pictures.animation.animate import animate

    target = folder / "animation.html"
    animate(trajectory, target)
    page = html.escape(target.read_text(encoding="utf-8"))
    style = f"width: 100%; height: {_HEIGHT}px; border: 0"
    return f'<iframe sandbox="allow-scripts" style="{style}" srcdoc="{page}"></iframe>'


def _plot(trajectory: Trajectory, folder: Path) -> str:
    from lagcli.pictures.plots.plot import plot

    target = folder / "plot.png"
    plot(trajectory, target, dpi=100)
    data = base64.b64encode(target.read_bytes()).decode()
    return f'<img style="max-width: 100%" alt="Plot of the run" src="data:image/png;base64,{data}">'
