"""Linear models and modes as JSON values, as text and as files."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from lagcli.analysis.linear.linear_model import LinearModel
from lagcli.analysis.linear.modes import ModalAnalysis, Mode
from lagcli.analysis.local.contacts import contact_lines, describe_contacts
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.output.files import (
    ANALYSIS_SUFFIXES,
    check_analysis_target,
    write_content,
)
from lagcli.analysis.output.tables import (
    Cell,
    ModelName,
    Phasor,
    Phrase,
    PlotPlace,
    Remark,
    ResultColumn,
    ResultSection,
    ResultTable,
    SectionBlock,
    TextColumn,
    more,
    names_of,
    note_remarks,
    state_quantities,
    unit_of,
)
from lagcli.analysis.output.text import entry, state_lines, width
from lagcli.prose import counted, wrapped
from lagcli.results.atomic import write_file

_SHOWN = 6  # components of a shape that are listed
_ENTRIES = 12  # largest number of rows and columns of a printed matrix
#: Largest numbers of modes, of components of shapes, and of quantities of a point in tables.
_MODES, _COMPONENTS, _QUANTITIES = 12, 24, 72
#: Components below this part of the largest of a shape are omitted from tables.
_NONE = 1e-9


def describe_point(operating_point: OperatingPoint, linear: LinearModel) -> dict[str, Any]:
    """Return an operating point as JSON values."""
    point = operating_point.point
    return {
        "name": operating_point.name,
        "steady": operating_point.steady,
        "time": point.t,
        "q": dict(zip(linear.coordinates, point.q.tolist(), strict=True)),
        "v": dict(zip(linear.coordinates, point.v.tolist(), strict=True)),
        "multipliers": dict(zip(linear.constraints, point.multipliers.tolist(), strict=True)),
        "contacts": describe_contacts(operating_point.contacts),
    }


def describe_linear(linear: LinearModel) -> dict[str, Any]:
    """Return the JSON values of ``lagcli linearize --json``: docs/schemas/linearize.json."""
    return {
        "command": "linearize",
        "model": linear.model.name,
        "form": linear.form,
        "operating_point": describe_point(linear.operating_point, linear),
        "states": list(linear.states),
        "inputs": list(linear.inputs),
        "outputs": list(linear.outputs),
        **{name: matrix.tolist() for name, matrix in matrices(linear).items()},
        "notes": list(linear.notes),
    }


def matrices(linear: LinearModel) -> dict[str, np.ndarray]:
    """Return the matrices by name."""
    names = ("E", "A", "B", "C", "D", "position_shape", "velocity_shape", "multiplier_shape")
    return {name: getattr(linear, name) for name in names}


def describe_modes(analysis: ModalAnalysis) -> dict[str, Any]:
    """Return the JSON values of ``lagcli modes --json``: docs/schemas/modes.json."""
    linear = analysis.linear_model
    return {
        "command": "modes",
        "model": linear.model.name,
        "operating_point": describe_point(analysis.operating_point, linear),
        "undamped": analysis.undamped,
        "degrees_of_freedom": len(analysis.operating_point.tangent.velocities),
        "modes": [_described(mode, i, linear) for i, mode in enumerate(analysis.modes, 1)],
        "notes": list(linear.notes),
    }


def _described(mode: Mode, number: int, linear: LinearModel) -> dict[str, Any]:
    s = mode.eigenvalue
    return {
        "number": number,
        "kind": mode.kind,
        "eigenvalue": [s.real, s.imag],
        "frequency": mode.frequency,
        "natural_frequency": mode.natural_frequency,
        "damping_ratio": mode.damping_ratio,
        "period": mode.period,
        "time_constant": mode.time_constant,
        "position": _by_name(linear.coordinates, mode.position),
        "velocity": _by_name(linear.coordinates, mode.velocity),
        "multipliers": _by_name(linear.constraints, mode.multipliers),
    }


def _by_name(names: Sequence[str], shape: np.ndarray) -> dict[str, list[float]]:
    return {name: [z.real, z.imag] for name, z in zip(names, shape.tolist(), strict=True)}


# tables


def linear_sections(content: Mapping[str, Any], units: Mapping[str, str]) -> list[ResultSection]:
    """Return the sections of a linear model; ``units`` by coordinate, and of λ by column."""
    lists = {"states x": "states", "inputs u": "inputs", "outputs y": "outputs"}
    blocks: list[SectionBlock] = [
        Remark(f"{label}: ", names_of(content[key])) for label, key in lists.items() if content[key]
    ]
    columns = {"A": "states", "B": "inputs", "C": "states", "D": "inputs", "E": "states"}
    for name, key in columns.items():
        rows = content[name]
        if not rows or not rows[0] or (name == "E" and content["form"] != "descriptor"):
            continue
        if max(len(rows), len(rows[0])) > _ENTRIES:
            blocks.append(Remark(f"{_size(name, rows)}; the file has them."))
            continue
        labels = content["outputs"] if name in "CD" else content["states"]
        entries = zip(*rows, strict=True)
        table = [
            ResultColumn("", [ModelName(label) for label in labels]),
            *(
                ResultColumn(ModelName(x), values, digits=8)
                for x, values in zip(content[key], entries, strict=True)
            ),
        ]
        blocks.append(ResultTable(Phrase(name), table))
    equation = "ẋ = A x" if content["form"] == "reduced" else "E ẋ = A x"
    equation += " + B u" * bool(content["inputs"])
    return [
        _point_section(content, units),
        ResultSection("linear", f"Linear model, {equation}", blocks),
    ]


def modes_sections(content: Mapping[str, Any], units: Mapping[str, str]) -> list[ResultSection]:
    """Return the sections of modes; ``units`` by coordinate, and of λ by column."""
    every, point = content["modes"], _point_section(content, units)
    if not every:
        nothing = Remark("None: the constraints determine the motion.")
        return [point, ResultSection("modes", "Modes", [nothing])]
    about = (
        "The coordinate that carries the most kinetic energy is 1; complex components are magnitude"
        " and phase. An oscillation of amplitude ε about λ₀ has λ(t) = λ₀ + ε Re(δλ eˢᵗ)."
        " `lagcli animate FILE --mode N` shows the motion."
    )
    drawn = PlotPlace("Eigenvalues in the complex plane")
    shapes = [
        *_shapes(every, "position", "Shapes", "Coordinate", "δ", "", units),
        *_shapes(
            every,
            "multipliers",
            "δλ in the same scale",
            "Multiplier",
            "δλ ",
            "lambda.",
            units,
        ),
    ]
    return [
        point,
        ResultSection("modes", "Modes", [_modes_table(content), drawn]),
        ResultSection("shapes", "Shapes", [*shapes, Remark(about, kind="note")]),
    ]


def _point_section(content: Mapping[str, Any], units: Mapping[str, str]) -> ResultSection:
    """Return the description of the point of linearization."""
    point = content["operating_point"]
    rows = state_quantities([point], units)
    shown = rows[:_QUANTITIES]
    columns = (
        ResultColumn("Quantity", [x.name for x in shown]),
        ResultColumn("Value", [x.values[0] for x in shown], digits=8),
        ResultColumn("Unit", [x.unit for x in shown]),
    )
    caption = Phrase(f"About {point['name']}, t = {{}} s", (point["time"],))
    blocks: list[SectionBlock] = [
        ResultTable(caption, columns),
        *more(len(rows), len(shown)),
        *note_remarks(content["notes"]),
    ]
    return ResultSection("point", "Operating point", blocks)


def _modes_table(content: Mapping[str, Any]) -> ResultTable:
    every = content["modes"]
    swings = [bool(mode["eigenvalue"][1]) for mode in every]

    def swinging(key: str) -> list[Cell]:
        return [x[key] if swing else "" for x, swing in zip(every, swings, strict=True)]

    columns = (
        ResultColumn("Mode", [x["number"] for x in every], text=TextColumn("mode", "  {:>4}")),
        ResultColumn(
            "Eigenvalue",
            [complex(*x["eigenvalue"]) for x in every],
            "1/s",
            9,
            TextColumn("eigenvalue, 1/s", "  {:<27}"),
        ),
        ResultColumn("Frequency", swinging("frequency"), "Hz", text=TextColumn("Hz", "{:>10}")),
        ResultColumn(
            "Damping ratio", swinging("damping_ratio"), "", 4, TextColumn("damping", "  {:>9}")
        ),
        ResultColumn("Time constant", [x["time_constant"] or "" for x in every], "s", 4),
        ResultColumn("Kind", [x["kind"] for x in every], text=TextColumn("kind", "  {}")),
    )
    return ResultTable(Phrase("By the magnitude of the eigenvalue"), columns)


def _shapes(
    every: Sequence[Mapping[str, Any]],
    part: str,
    caption: str,
    label: str,
    sign: str,
    prefix: str,
    units: Mapping[str, str],
) -> list[SectionBlock]:
    """Return the table of shapes in the coordinates or multipliers; none without any."""
    names = list(every[0][part])
    shown = names[:_COMPONENTS]
    if not shown:
        return []
    columns = [
        ResultColumn(label, [ModelName(sign + name) for name in shown]),
        ResultColumn("Unit", [unit_of(prefix + name, units) for name in shown]),
        *(
            ResultColumn(f"Mode {mode['number']}", _components(mode[part], shown), digits=4)
            for mode in every[:_MODES]
        ),
    ]
    return [ResultTable(Phrase(caption), columns), *more(len(names), len(shown))]


def _components(shape: Mapping[str, Sequence[float]], names: Sequence[str]) -> list[Cell]:
    """Return components of a shape, with zeros for rounding errors."""
    values = {name: complex(*x) for name, x in shape.items()}
    largest = max(map(abs, values.values()))
    return [Phasor(z) if abs(z) > _NONE * largest else 0.0 for z in map(values.__getitem__, names)]


# text


def format_linear(content: Mapping[str, Any]) -> str:
    """Return the text that ``lagcli linearize`` prints."""
    lines = _head(content, "linear model about")
    n, m, o = (len(content[name]) for name in ("states", "inputs", "outputs"))
    form = content["form"]
    equation = "ẋ = A x" if form == "reduced" else "E ẋ = A x"
    equation += " + B u" if m else ""
    equation += ", y = C x" + (" + D u" if m else "") if o else ""
    lines.append(f"  {'form':<9}{form}: {equation}; {counted(n, 'state')}")
    for name, label in (("states", "x"), ("inputs", "u"), ("outputs", "y")):
        if content[name]:
            lines += entry(label, ", ".join(content[name]))
    shown = ["A", *(["E"] if form == "descriptor" else [])]
    shown += ["B"] * bool(m) + ["C"] * bool(o) + ["D"] * bool(m and o)
    for name in shown:
        lines += _matrix(name, content[name])
    return "\n".join([*lines, *_notes(content)])


def format_modes(content: Mapping[str, Any]) -> str:
    """Return the text that ``lagcli modes`` prints."""
    lines = _head(content, "modes about")
    freedom = content["degrees_of_freedom"]
    lines.append(
        f"  {counted(freedom, 'degree')} of freedom"
        + ("; no damping, no gyroscopic forces" if content["undamped"] and freedom else "")
    )
    if not content["modes"]:
        lines.append("  no modes: the constraints determine the motion")
        return "\n".join([*lines, *_notes(content)])
    lines += ["", *_modes_table(content).lines(), ""]
    for mode in content["modes"]:
        shape = _shape(mode["position"])
        forces = _shape({f"λ {k}": v for k, v in mode["multipliers"].items()})
        head = f"  {mode['number']:>4}  "
        for text in (f"δq: {shape}", *([f"δλ: {forces}"] if forces else ())):
            lines += wrapped(text, width(), head, " " * 12)
            head = " " * 8
    return "\n".join([*lines, *_notes(content)])


def _head(content: Mapping[str, Any], what: str) -> list[str]:
    point = content["operating_point"]
    lines = [f"{content['model']}: {what} {point['name']}"]
    lines += state_lines(point, 2)
    return [*lines, *contact_lines(point.get("contacts", ()), 2)]


def _shape(components: Mapping[str, Sequence[float]]) -> str:
    """Return the largest components of a shape, in the order of the model."""
    values = {name: complex(*x) for name, x in components.items()}
    largest = max(map(abs, values.values()), default=0.0)
    moving = [n for n, z in values.items() if abs(z) > 1e-6 * largest]
    kept = set(sorted(moving, key=lambda n: -abs(values[n]))[:_SHOWN])
    texts = [f"{name} {_component(values[name])}" for name in moving if name in kept]
    more = len(moving) - len(texts)
    return ", ".join([*texts, *([f"and {more} more"] if more else [])]) or "none"


def _component(z: complex) -> str:
    if abs(z.imag) <= 1e-9 * abs(z):
        return f"{z.real:.4g}"
    return f"{abs(z):.4g}∠{np.degrees(np.angle(z)):.0f}°"


def _matrix(name: str, rows: Sequence[Sequence[float]]) -> Iterator[str]:
    columns = len(rows[0]) if rows else 0
    if len(rows) > _ENTRIES or columns > 6:
        yield f"  {_size(name, rows)} (--json, -o)"
        return
    texts = [[f"{x:.6g}" for x in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    for i, row in enumerate(texts):
        cells = "  ".join(f"{x:>{w}}" for x, w in zip(row, widths, strict=True))
        yield f"  {name + ' =' if not i else '':<5}[ {cells} ]"


def _size(name: str, rows: Sequence[Sequence[float]]) -> str:
    nonzero = sum(1 for row in rows for x in row if x)
    return f"{name}: {len(rows)} by {len(rows[0]) if rows else 0}, {nonzero} entries are not zero"


def _notes(content: Mapping[str, Any]) -> Iterator[str]:
    for note in content["notes"]:
        yield from wrapped(f"note: {note}", width(), "  ", " " * 8)


LINEAR_SUFFIXES = (".json", ".npz", ".mat", ".h5")


def write_linear(linear: LinearModel, path: str, force: bool) -> None:
    """Write a linear model in the format given by the suffix.

    ``.npz`` and ``.mat`` contain the matrices by name and the names of the states, inputs and
    outputs; ``scipy.signal.StateSpace(A, B, C, D)`` and MATLAB's ``ss(A, B, C, D)`` accept them.

    Raises
    ------
    UsageError, FileError
        As `check_analysis_target`.
    """
    check_analysis_target(path, LINEAR_SUFFIXES, force)
    content = describe_linear(linear)
    arrays: dict[str, Any] = dict(matrices(linear))
    names: dict[str, Any] = {
        name: np.array(content[name], dtype=str) for name in ("states", "inputs", "outputs")
    }
    suffix = os.path.splitext(path)[1].lower()
    if suffix == ".npz":
        held = io.BytesIO()
        np.savez(held, allow_pickle=False, **arrays, **names)
        write_file(path, held.getvalue(), force)
    elif suffix == ".mat":
        from scipy.io import savemat

        held = io.BytesIO()
        lists: Mapping[str, Any] = {k: np.array(v, dtype=object) for k, v in names.items()}
        savemat(held, {**arrays, **lists, "model": linear.model.name}, oned_as="column")
        write_file(path, held.getvalue(), force)
    else:
        write_content(content, arrays, linear.model, path, force)


def write_modes(analysis: ModalAnalysis, path: str, force: bool) -> None:
    """Write modes as JSON or HDF5.

    Raises
    ------
    UsageError, FileError
        As `check_analysis_target`.
    """
    check_analysis_target(path, ANALYSIS_SUFFIXES, force)
    arrays = {"eigenvalue": _parts(np.array([m.eigenvalue for m in analysis.modes]))}
    for name in ("position", "velocity", "multipliers"):
        arrays[name] = _parts(np.array([getattr(m, name) for m in analysis.modes]))
    write_content(describe_modes(analysis), arrays, analysis.linear_model.model, path, force)


def _parts(values: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts along a new last axis."""
    return np.stack([values.real, values.imag], axis=-1)
