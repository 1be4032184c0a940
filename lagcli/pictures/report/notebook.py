"""Rich display of models, equations and runs in notebooks."""

from __future__ import annotations

import base64
import html
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from lagcli.errors import LagcliError
from lagcli.model.expression.units import si_notation
from lagcli.prose import counted

if TYPE_CHECKING:
    from lagcli.analysis.check.check import Check
    from lagcli.equations.derivation.lagrange import Equations
    from lagcli.model.model import Model
    from lagcli.sweeps.run import Summary
    from lagcli.trajectory.trajectory import Trajectory


_HEIGHT = 560  # pixels of an animation
_SIZE = (640, 420)  # of a still picture, pixels
#: Largest numbers of constraints, and of rows of a table, that are shown without folding, and of
#: rows at all.
_LISTED, _ROWS = 12, 200
#: Results of analyses: their modules in `lagcli.analysis` and their types.
_RESULTS = (
    ("compare.comparison", "FormulationComparison"),
    ("compare.two_models", "ModelComparison"),
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
        ("text/html", "lagcli.model.model", "Model", model_html),
        ("text/markdown", "lagcli.analysis.check.check", "Check", check_markdown),
        ("text/html", "lagcli.sweeps.run", "Summary", sweep_html),
        ("text/markdown", "lagcli.equations.derivation.lagrange", "Equations", equations_markdown),
        ("text/html", "lagcli.trajectory.trajectory", "Trajectory", trajectory_html),
        *(
            ("text/html", f"lagcli.analysis.{module}", type_, analysis_html)
            for module, type_ in _RESULTS
        ),
    ):
        formatters[format_].for_type_by_name(module, type_, function)


def model_html(model: Model) -> str:
    """Return a model as a card in HTML: its size, coordinates, constraints and parameters."""
    from lagcli.pictures.page import number, paragraphs, unit

    coordinates = [[_named(c.name), unit(c.unit), _text(c.description)] for c in model.coordinates]
    parameters = [
        [
            _named(p.name),
            number(p.value),
            unit(p.unit and si_notation(p.unit)),
            _text(p.description),
        ]
        for p in model.parameters.values()
    ]
    constraints = ", ".join(map(_named, model.constraint_names[:_LISTED]))
    more = len(model.constraint_names) - _LISTED
    constraints += f" and {more} more" if more > 0 else ""
    parts = [
        f"<p><b>{html.escape(model.title)}</b></p>{paragraphs(model.description)}",
        _cut("Coordinates", ["Name", "Unit", "Meaning"], coordinates),
        f"<p>Constraints: {constraints or 'none'}.</p>",
        _cut("Parameters, in SI", ["Name", "Value", "Unit", "Meaning"], parameters, numeric=(1,)),
        "<p><code>lagcli.derive(model)</code> shows the equations.</p>",
    ]
    return "\n".join(x for x in parts if x)


def _cut(title: str, head: list[str], rows: list[list[str]], numeric: tuple[int, ...] = ()) -> str:
    """Return a table of the first rows, folded if it is long; nothing without rows."""
    from lagcli.pictures.page import table

    if not rows:
        return ""
    shown = table(title, head, rows[:_ROWS], numeric=numeric)
    more = f"<p>{len(rows) - _ROWS} more.</p>" if len(rows) > _ROWS else ""
    if len(rows) <= _LISTED:
        return shown
    return f"<details><summary>{title}: {len(rows)}</summary>{shown}{more}</details>"


def _named(name: str) -> str:
    return f"<code>{html.escape(name)}</code>"


def _text(text: str | None) -> str:
    return html.escape(text or "")


def check_markdown(checked: Check) -> str:
    """Return a check in Markdown with LaTeX."""
    from lagcli.analysis.check.description import markdown

    return markdown(checked)


def sweep_html(summary: Summary) -> str:
    """Return the summary of a sweep in HTML: its rows, failures and ranges of measures."""
    from lagcli.pictures.page import number, table, unit

    said = (
        f"{summary.ok} of {counted(summary.rows, 'row')} completed, {number(summary.seconds, 3)} s"
    )
    said += f"; {_named(summary.output)}" if summary.output else ""
    parts = [f"<p><b>Sweep</b>: {summary.status}, {said}</p>"]
    failures = [[html.escape(why), str(count)] for why, count in summary.failed.items()]
    ranges = [
        [
            _named(name),
            number(x["min"]),
            str(x["row_min"]),
            number(x["max"]),
            str(x["row_max"]),
            unit(x["unit"]),
        ]
        for name, x in summary.ranges.items()
    ]
    if ranges:
        head = ["Measure", "Least", "in row", "Largest", "in row", "Unit"]
        parts.append(table("Measures", head, ranges, numeric=(1, 2, 3, 4)))
    if failures:
        parts.append(table("Failed rows", ["Reason", "Rows"], failures, numeric=(1,)))
    return "\n".join(parts)


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
    return "\n".join(f"<h4>{x.title}</h4>{x.body}" for x in sections if x.body)


def trajectory_html(trajectory: Trajectory) -> str:
    """Return a run in HTML: its status, animation, last frame and plot.

    Pages that keep no scripts, such as exported notebooks, show the frame alone.
    """
    from lagcli.pictures.page import with_code
    from lagcli.results.metadata import model_title

    name = model_title(trajectory.model) or "run"
    times = trajectory.time
    span = (
        f", t = {times[0]:g} to {times[-1]:g} s, {counted(len(times), 'sample')}"
        if len(times)
        else ""
    )
    message = f": {with_code(trajectory.message)}" if trajectory.message else ""
    title = f"<p><b>{html.escape(name)}</b>: {trajectory.status}{message}{span}</p>"
    return "\n".join([title, *(_picture(make, trajectory) for make in (_animation, _still, _plot))])


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
    return (
        f'<iframe sandbox="allow-scripts" title="Animation of the run" style="{style}"'
        f' srcdoc="{page}"></iframe>'
    )


def _still(trajectory: Trajectory, folder: Path) -> str:
    """Return a picture of the mechanism in the run; nothing if it cannot be drawn."""
    from lagcli.pictures.run_file import RunFile
    from lagcli.pictures.scene.still import still_picture
    from lagcli.pictures.scene.view_evaluator import scene_of

    run = RunFile(trajectory)
    scene = scene_of(run) if run.knows_model and run.count else None
    picture = None if scene is None else still_picture(scene, _SIZE)
    if picture is None:
        return ""
    target = folder / "still.png"
    target.write_bytes(picture)
    return _image(target, "The mechanism at one moment of the run")


def _plot(trajectory: Trajectory, folder: Path) -> str:
    from lagcli.pictures.plots.plot import plot

    target = folder / "plot.png"
    plot(trajectory, target, dpi=100)
    return _image(target, "Plot of the run")


def _image(file: Path, caption: str) -> str:
    data = base64.b64encode(file.read_bytes()).decode()
    return f'<img style="max-width: 100%" alt="{caption}" src="data:image/png;base64,{data}">'
