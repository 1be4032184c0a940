"""FMUs of FMI 2.0 and 3.0: the core's libraries, the model as data, and its variables."""

from __future__ import annotations

import hashlib
import io
import os
import platform
import re
import sys
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from lagcli.columns import ColumnName, unit_of_column
from lagcli.engine.core.library import LIBRARY
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.column_expressions import REPORTED
from lagcli.errors import UsageError
from lagcli.export.content import LICENCE, independent_constraints
from lagcli.export.names import Identifiers
from lagcli.export.terminals import draw_icon, terminals, terminals_and_icons
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.units import UnknownUnit, read_unit
from lagcli.model.model import Model, check_is_model, velocity
from lagcli.model.result_units import result_units
from lagcli.model.values import dependent_values
from lagcli.simulations.contacts import refuse_nonlinear_impulses
from lagcli.simulations.resources import (
    DerivedTape,
    derivatives,
    method_of,
    resources,
    settable_parameters,
)
from lagcli.simulations.simulation import Simulation, prepare
from lagcli.version import __version__

#: The versions of FMI.
VERSIONS = ("2.0", "3.0")
#: The bases of units that FMI knows, as `lagcli.model.expression.dimension.Dimension` has them.
_BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


#: What co-simulation of FMI 3.0 can do, as attributes of its description.
_EVENTS = (
    "providesIntermediateUpdate",
    "mightReturnEarlyFromDoStep",
    "canReturnEarlyAfterIntermediateUpdate",
    "hasEventMode",
)


class Platform(NamedTuple):
    """A platform on which an FMU may be used.

    Parameters
    ----------
    tag : str
        A pattern of the platform tags of its wheels.
    suffix : str
        Of libraries.
    folders : tuple of str
        The folders of its libraries in FMUs of FMI 2.0, which does not know all platforms, and 3.0.
    """

    tag: str
    suffix: str
    folders: tuple[str, str]


PLATFORMS = (
    Platform(r"manylinux.*_x86_64", "so", ("linux64", "x86_64-linux")),
    Platform(r"manylinux.*_aarch64", "so", ("", "aarch64-linux")),
    Platform(r"win_amd64", "dll", ("win64", "x86_64-windows")),
    Platform(r"macosx.*_x86_64", "dylib", ("darwin64", "x86_64-darwin")),
    Platform(r"macosx.*_arm64", "dylib", ("", "aarch64-darwin")),
)


class FmuVariable(NamedTuple):
    """A variable of an FMU.

    Parameters
    ----------
    name, unit, description : str
    reference : int
        Value reference.
    causality, variability, initial : str
        As FMI calls them; `initial` may be empty.
    start : float or None
    derivative : int or None
        The reference of the variable whose derivative with respect to time it is.
    """

    name: str
    reference: int
    causality: str
    variability: str
    initial: str = ""
    start: float | None = None
    unit: str = ""
    description: str = ""
    derivative: int | None = None


def fmu(
    model: Model,
    version: str = "2.0",
    inputs: Sequence[str] = (),
    wheels: str | None = None,
    icon: bool = True,
) -> bytes:
    """Return a model as an FMU.

    Parameters
    ----------
    model : Model
    version : str
        Of FMI: ``"2.0"`` or ``"3.0"``.
    inputs : sequence of str
        Parameters that become inputs, which may change during a simulation.
    wheels : str, optional
        A folder with wheels of this version of lagcli for other platforms, whose libraries the FMU
        also gets. It always has that of this machine.
    icon : bool
        Whether the FMU gets a picture of the mechanism, for which the model is simulated and
        drawn; models without a view and installations without matplotlib give none.

    Raises
    ------
    UsageError
        There is no such version; an input is not a parameter, or one that cannot change; there is
        no wheel in the folder; an impulse may act on a constraint nonlinear in the velocities.
    ModelError, NumericalError
        There is no consistent initial state.
    """
    check_is_model(model, "fmu")
    if version not in VERSIONS:
        raise UsageError(f"there is no FMI {version}; known are {', '.join(VERSIONS)}")
    refuse_nonlinear_impulses(model, "an FMU")
    return _Fmu(prepare(model), version, inputs).packed(_libraries(version, wheels), icon)


class _Fmu:
    """An FMU of a prepared run."""

    def __init__(self, simulation: Simulation, version: str, inputs: Sequence[str]):
        self.simulation, self.model, self.system = simulation, simulation.model, simulation.system
        self.version = version
        self.settable = settable_parameters(self.model)
        self.inputs = tuple(inputs)
        self._check_inputs()
        self.identifier = Identifiers(()).of(self.model.name)

    def _check_inputs(self) -> None:
        for name in self.inputs:
            if name not in self.settable:
                kind = "computed or structural" if name in self.model.parameters else "unknown"
                raise UsageError(
                    f"--input {name}: an input is a parameter with a value of its own; this one is"
                    f" {kind}"
                )
            self._check_changes(name)

    def _check_changes(self, name: str) -> None:
        """Raise UsageError if positions or velocities would jump with a parameter.

        These are the rules of tables with steps. What an event sets has a value already.
        """
        model = self.model
        follows = {name, *dependent_values(model, [name])} & set(model.parameters)
        for event in model.events:
            for target in follows & set(event.action.set):
                raise UsageError(
                    f"--input {name}: the event `{event.name}` sets `{target}`; an input has one"
                    " source, so leave this out of the event, or of the inputs"
                )
        energy = -model.potential if model.kinetic is None else model.kinetic
        momenta = [derivative(energy, velocity(q)) for q in model.coordinate_names]
        used = [("the kinetic energy depends", momenta)]
        used += [(f"the constraint `{c.name}` depends", [c.expression]) for c in model.constraints]
        for what, expressions in used:
            if any(follows & {x.name for x in e.free_symbols} for e in expressions):
                raise UsageError(
                    f"--input {name}: {what} on it, so that the motion would jump with it; an input"
                    " acts by forces, events and friction: make it a parameter, or write its effect"
                    " as a force"
                )

    @property
    def exchanges(self) -> bool:
        """Whether the FMU is also for model exchange: nothing switches, and no table has knots."""
        return not self.model.switches and not self.model.inputs and not self.system.has_kinks

    @cached_property
    def derived(self) -> tuple[tuple[str, str], ...]:
        """The derived values with their units: constraint forces, energies and powers, outputs."""
        units = result_units(self.model)
        columns = [ColumnName(name) for name in REPORTED]
        if self.system.constraints:
            forces = [ColumnName("constraint_force", coordinate=q) for q in self.system.coordinates]
            columns = [*forces, *columns]
        named = [(str(column), unit_of_column(column, units) or "") for column in columns]
        return (*named, *((name, units.get(name, "")) for name in self.system.outputs))

    def packed(self, libraries: Mapping[tuple[str, str], bytes], icon: bool) -> bytes:
        """Return the FMU as the contents of its file."""
        method = method_of(self.simulation)
        model, values = resources(self.simulation, method, self._derived_tape(), self.inputs)
        token = hashlib.sha256(model + values + self.version.encode()).hexdigest()
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as file:
            for name, content in {
                "modelDescription.xml": self.description(token),
                "resources/model.bin": model,
                "resources/values.bin": values,
                **self._derivatives(),
                "documentation/index.html": self.documentation(),
                **self._appearance(icon),
                **{
                    f"binaries/{folder}/{self.identifier}.{suffix}": content
                    for (folder, suffix), content in libraries.items()
                },
            }.items():
                # the same model gives the same file
                entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
                file.writestr(entry, content, zipfile.ZIP_DEFLATED)
        return out.getvalue()

    def _derived_tape(self) -> Tape:
        tape = DerivedTape(self.system)
        forces = tape.forces if self.system.constraints else []
        return tape.builder.finish([*forces, *tape.reported])

    @cached_property
    def _directions(self) -> bytes | None:
        rows = None if self.model.switches else independent_constraints(self.simulation)
        return derivatives(self.simulation, self._derived_tape(), rows)

    def _derivatives(self) -> dict[str, bytes]:
        """Return the file of directional derivatives, by its name."""
        found = self._directions
        return {} if found is None else {"resources/derivatives.bin": found}

    def _appearance(self, icon: bool) -> dict[str, bytes]:
        """Return the icon and, for FMI 3.0, the terminals, by the names of their files."""
        picture = draw_icon(self.simulation) if icon else None
        if self.version == "2.0":
            return {} if picture is None else {"model.png": picture}
        found = {} if picture is None else {"terminalsAndIcons/icon.png": picture}
        described = terminals_and_icons([*terminals(self.model, self.inputs)], picture is not None)
        if described is not None:
            found["terminalsAndIcons/terminalsAndIcons.xml"] = described
        return found

    # modelDescription.xml

    def variables(self) -> Iterator[FmuVariable]:
        """Yield the variables in the order of their value references."""
        model, system, state = self.model, self.system, self.simulation.start.state
        units = result_units(model)
        nq, nc = len(system.coordinates), len(system.constraints)
        described = {c.name: c.description or "" for c in model.coordinates}
        fixed = model.initial_positions, model.initial_velocities

        def unit(name: ColumnName) -> str:
            return unit_of_column(name, units) or ""

        yield FmuVariable("time", 0, "independent", "continuous", unit="s", description="time")
        for order, (what, values) in enumerate((("q", state.q), ("v", state.v), ("a", None))):
            for i, name in enumerate(system.coordinates):
                column, text = ColumnName(what, coordinate=name), described[name]
                exact = values is not None and fixed[order][name].fixed
                yield FmuVariable(
                    str(column),
                    1 + order * nq + i,
                    "output",
                    "continuous",
                    "calculated" if values is None else "exact" if exact else "approx",
                    None if values is None else float(values[i]),
                    unit(column),
                    text if not order else "",
                    None if not order else 1 + (order - 1) * nq + i,
                )
        for i, c in enumerate(model.constraints):
            column = ColumnName("multipliers", c.name)
            text = c.description or f"multiplier of {c.name}"
            yield FmuVariable(
                str(column), 1 + 3 * nq + i, "output", "continuous", "calculated", None,
                unit(column), text,
            )  # fmt: skip
        first = 1 + 3 * nq + nc
        for i, (name, own) in enumerate(self.derived):
            yield FmuVariable(name, first + i, "output", "continuous", "calculated", None, own)
        first += len(self.derived)
        for i, p in enumerate(model.parameters.values()):
            about = units.get(p.name, ""), p.description or ""
            if p.name in self.inputs:
                yield FmuVariable(p.name, first + i, "input", "continuous", "", p.value, *about)
            elif p.name in self.settable:
                yield FmuVariable(p.name, first + i, "parameter", "fixed", "exact", p.value, *about)
            else:
                yield FmuVariable(
                    p.name, first + i, "calculatedParameter", "fixed", "calculated", None, *about
                )

    def description(self, token: str) -> bytes:
        """Return modelDescription.xml."""
        variables = list(self.variables())
        root = Xml.Element("fmiModelDescription", self._attributes(token))
        kinds = ["CoSimulation"] if not self.exchanges else ["ModelExchange", "CoSimulation"]
        for kind in kinds:
            Xml.SubElement(root, kind, self._capabilities(kind))
        units = {v.unit: exponents for v in variables if (exponents := _exponents(v.unit))}
        if units:
            definitions = Xml.SubElement(root, "UnitDefinitions")
            for unit, exponents in sorted(units.items()):
                one = Xml.SubElement(definitions, "Unit", name=unit)
                Xml.SubElement(one, "BaseUnit", exponents)
        categories = Xml.SubElement(root, "LogCategories")
        Xml.SubElement(categories, "Category", name="logStatusError", description="errors")
        settings = self.simulation.settings
        step = (settings.t_end - settings.t_start) / max(1, settings.sample_count - 1)
        Xml.SubElement(
            root,
            "DefaultExperiment",
            startTime=repr(settings.t_start),
            stopTime=repr(settings.t_end),
            stepSize=repr(step),
            tolerance=repr(settings.rtol),
        )
        if self.version == "2.0":
            self._variables_of_2(root, variables[1:], units)
        else:
            self._variables_of_3(root, variables, units)
        Xml.indent(root)
        return b'<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, "utf-8")

    def _attributes(self, token: str) -> dict[str, str]:
        model = self.model
        named = "guid" if self.version == "2.0" else "instantiationToken"
        attributes = {
            "fmiVersion": self.version,
            "modelName": model.name,
            named: token,
            "description": model.title,
            "copyright": LICENCE,
            "generationTool": f"lagcli {__version__}",
            "variableNamingConvention": "flat",
        }
        if self.version == "2.0" and self.exchanges:
            attributes["numberOfEventIndicators"] = "0"
        return attributes

    def _capabilities(self, kind: str) -> dict[str, str]:
        two = self.version == "2.0"
        capabilities = {
            "modelIdentifier": self.identifier,
            "canGetAndSetFMUstate" if two else "canGetAndSetFMUState": "true",
            "canSerializeFMUstate" if two else "canSerializeFMUState": "true",
        }
        if self._directions is not None:
            several = "" if two else "s"
            capabilities[f"providesDirectionalDerivative{several}"] = "true"
            if not two:
                capabilities["providesAdjointDerivatives"] = "true"
        if kind == "CoSimulation":
            capabilities["canHandleVariableCommunicationStepSize"] = "true"
            if not two:
                capabilities |= dict.fromkeys(_EVENTS, "true")
        elif two:
            capabilities["completedIntegratorStepNotNeeded"] = "false"
        else:
            capabilities["needsCompletedIntegratorStep"] = "true"
        return capabilities

    def _variables_of_2(
        self, root: Xml.Element, variables: Sequence[FmuVariable], units: dict[str, dict[str, str]]
    ) -> None:
        listed = Xml.SubElement(root, "ModelVariables")
        for v in variables:
            one = Xml.SubElement(listed, "ScalarVariable", _attributes_of(v))
            # without the time, the number of a variable is its value reference
            Xml.SubElement(one, "Real", _numbers(v, units, self.exchanges))
        structure = Xml.SubElement(root, "ModelStructure")
        parts = {
            "Outputs": [v for v in variables if v.causality == "output"],
            "Derivatives": self._state_derivatives(variables),
            "InitialUnknowns": _initial_unknowns(variables),
        }
        for name, some in parts.items():
            if some:
                part = Xml.SubElement(structure, name)
                for v in some:
                    Xml.SubElement(part, "Unknown", index=str(v.reference))

    def _variables_of_3(
        self, root: Xml.Element, variables: Sequence[FmuVariable], units: dict[str, dict[str, str]]
    ) -> None:
        listed = Xml.SubElement(root, "ModelVariables")
        for v in variables:
            attributes = _attributes_of(v) | _numbers(v, units, self.exchanges)
            if v.causality == "output":
                attributes["intermediateUpdate"] = "true"
            Xml.SubElement(listed, "Float64", attributes)
        structure = Xml.SubElement(root, "ModelStructure")
        for v in variables:
            if v.causality == "output":
                Xml.SubElement(structure, "Output", valueReference=str(v.reference))
        for v in self._state_derivatives(variables):
            Xml.SubElement(structure, "ContinuousStateDerivative", valueReference=str(v.reference))
        for v in _initial_unknowns(variables):
            Xml.SubElement(structure, "InitialUnknown", valueReference=str(v.reference))

    def _state_derivatives(self, variables: Sequence[FmuVariable]) -> list[FmuVariable]:
        """Return the derivatives of the states q and v."""
        return [v for v in variables if v.derivative is not None] if self.exchanges else []

    def documentation(self) -> bytes:
        """Return a page on the FMU."""
        model = self.model
        text = (
            "<!DOCTYPE html><html lang='en'><meta charset='utf-8'><meta name='viewport'"
            " content='width=device-width'>"
            "<style>body{font:1rem/1.5 sans-serif;max-width:46rem;margin:auto;padding:1rem;"
            f"overflow-wrap:anywhere}}</style><title>{_escaped(model.title)}"
            f"</title><h1>{_escaped(model.title)}</h1><p>{_escaped(model.description or '')}</p>"
            f"<p>Written by lagcli {__version__} from the model {_escaped(model.name)}, SHA-256"
            f" {model.sha256}. All values are in SI units. Constraint forces are Bᵀλ, on the right"
            " side of the equations of motion. Initial values that are set hold; the others are"
            f" adjusted to the constraints.</p><p>{LICENCE}</p></html>\n"
        )
        return text.encode()


def _libraries(version: str, wheels: str | None) -> dict[tuple[str, str], bytes]:
    """Return the core's libraries by their folder in an FMU, and their suffix."""
    place = VERSIONS.index(version)
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine()
    )
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    found = {}
    if wheels is not None:
        if not os.path.isdir(wheels):
            raise UsageError(f"--wheels {wheels}: there is no such folder")
        for name in sorted(os.listdir(wheels)):
            match = re.fullmatch(rf"lagcli-{re.escape(__version__)}-py3-none-(.*)\.whl", name)
            if match is None:
                continue
            for row in PLATFORMS:
                if row.folders[place] and re.fullmatch(row.tag, match[1]):
                    library = _library_of(os.path.join(wheels, name), row.suffix)
                    found[row.folders[place], row.suffix] = library
        if not found:
            raise UsageError(
                f"--wheels {wheels}: there is no wheel of lagcli {__version__} for a platform of"
                f" FMI {version}"
            )
    for row in PLATFORMS:
        if row.folders[1] == f"{machine}-{system}" and row.folders[place]:
            found.setdefault((row.folders[place], row.suffix), LIBRARY.read_bytes())
    if not found:
        raise UsageError(f"FMI {version} has no name for this platform, {machine}-{system}")
    return found


def _library_of(wheel: str, suffix: str) -> bytes:
    """Return the core's library of a wheel."""
    try:
        with zipfile.ZipFile(wheel) as file:
            return file.read(f"lagcli/engine/core/liblagcore.{suffix}")
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise UsageError(f"--wheels: cannot read the library of {wheel}: {error}") from None


def _initial_unknowns(variables: Sequence[FmuVariable]) -> list[FmuVariable]:
    """Return the variables whose start values the initialization computes."""
    return [v for v in variables if v.initial in ("calculated", "approx")]


def _attributes_of(v: FmuVariable) -> dict[str, str]:
    """Return the attributes that variables of all types have."""
    attributes = {
        "name": v.name,
        "valueReference": str(v.reference),
        "causality": v.causality,
        "variability": v.variability,
        "initial": v.initial,
        "description": v.description,
    }
    return {name: text for name, text in attributes.items() if text}


def _numbers(v: FmuVariable, units: dict[str, dict[str, str]], exchanges: bool) -> dict[str, str]:
    """Return the attributes of a variable that only numbers have."""
    attributes = {}
    if v.unit in units:
        attributes["unit"] = v.unit
    if v.start is not None:
        attributes["start"] = repr(v.start)
    if v.derivative is not None and exchanges:
        attributes["derivative"] = str(v.derivative)
    return attributes


def _exponents(unit: str) -> dict[str, str]:
    """Return the exponents of an SI unit; none if it has none, or one that is not an integer."""
    if not unit:
        return {}
    try:
        dimension = read_unit(unit).dimension
    except UnknownUnit:
        return {}
    exponents = {base: getattr(dimension, base) for base in _BASES}
    if any(x != int(x) for x in exponents.values()):
        return {}
    return {base: str(int(x)) for base, x in exponents.items() if x}


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")
