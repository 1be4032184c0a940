"""Common parts of the pages of runs and of analyses: frame, equations, model file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from string import Template

from lagcli.arrays import Array
from lagcli.model.model import Model
from lagcli.pictures.page import asset, page
from lagcli.pictures.report.equations import EquationSystem
from lagcli.pictures.report.writing import paragraphs
from lagcli.pictures.report.yaml_text import highlighted

Links = Sequence[tuple[str, str]]  # anchors and titles


def report_page(
    model: Model,
    system: EquationSystem,
    *,
    template: str,
    title: str | None,
    contents: Links,
    styles: Iterable[str],
    scripts: Sequence[str],
    layout: str = "without-motion",
    images: bool = False,
    status: str = "",
    start: Sequence[Array] = (),
    conserved: str = "",
    steps: str = "",
    **parts: str,
) -> str:
    """Return the page of a run or of an analysis.

    Parameters
    ----------
    model : Model
    system : EquationSystem
    template : str
        The asset with the page's sections, in which ``parts`` are inserted.
    title : str, optional
        Title instead of the model's.
    contents : sequence of (anchor, title)
        The sections, in the order of the page.
    styles, scripts : iterables of str
        Texts of the scripts.
    layout, images
        See `lagcli.pictures.page.page`.
    status : str
        HTML before the contents.
    start : sequence of arrays
        Initial coordinates and velocities.
    conserved, steps : str
        HTML of conserved quantities, and of the derivation.
    **parts : str
        HTML.
    """
    name = title or model.title
    sections = {
        "equations": _filled(
            "equations.html",
            freedom=system.freedom(),
            definitions=system.definitions(),
            energies=system.energies(),
            forces=system.forces(),
            constraints=system.constraints(),
            equations=system.motion(),
            convention=system.convention(),
            steps=steps,
        ),
        "system": _filled(
            "system.html",
            coordinates=system.coordinates(start),
            parameters=system.parameters(),
            conserved=conserved,
        ),
        "model": _filled("model.html", model=highlighted(model.text)),
    }
    body = _filled(
        "report_page.html",
        title=escape(name),
        description=paragraphs(model.description),
        status=status,
        contents="\n".join(f'<li><a href="#{anchor}">{said}</a></li>' for anchor, said in contents),
        content=_filled(template, **sections, **parts),
    )
    return page(name, body, styles=styles, scripts=scripts, layout=layout, images=images)


def _filled(template: str, **parts: str) -> str:
    return Template(asset(template)).substitute(parts)
