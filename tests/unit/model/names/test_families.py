"""Families: members, sums over an index, and parameters that count."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
import symengine as se
from growth import assert_growth

import lagcli
from lagcli.columns import SCALARS
from lagcli.errors import ModelError
from lagcli.functions import FUNCTIONS
from lagcli.model.model import Model
from lagcli.model.names import families
from lagcli.model.names.members import MAX_MEMBERS

MODELS = Path(__file__).parents[4] / "models"


def load(*lines: str, **options: dict[str, object]) -> Model:
    """Load a model with coordinates x[1..N] and y, of which the given lines replace parts."""
    parts = {
        "coordinates": "coordinates: [x[1..N], y]",
        "parameters": "parameters: {N: 3, l: 2 m}",
        "definitions": "definitions: {x[0]: 0}",
        "T": "T: sum(x[i]'^2, i = 1..N)/2 + y'^2/2",
        "initial": "initial: {x[1..N]: 0, x[1..N]': 0, y: 0, y': 0}",
    }
    for line in lines:
        parts[line.partition(":")[0]] = line
    return lagcli.load_text("\n".join(parts.values()), "f.yaml", **options)


def complaints(*lines: str, **options: dict[str, object]) -> list[str]:
    with pytest.raises(ModelError) as caught:
        load(*lines, **options)
    return [d.render() for d in caught.value.diagnostics]


def value(expression: str, *lines: str) -> str:
    """Return what a definition is built to."""
    model = load(f"definitions: {{x[0]: 0, it: '{expression}'}}", *lines)
    return str(model.definitions["it"].value)


# members


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("x[1..N]", ["x[1]", "x[2]", "x[3]"]),
        ("x[i = 0..N-2]", ["x[0]", "x[1]"]),
        ("x[-1..0]", ["x[-1]", "x[0]"]),
        ("x[2*N]", ["x[6]"]),
        ("x[floor(N/2)..max(1, N - 1)]", ["x[1]", "x[2]"]),
        ("x[1..N^2 - 8]", ["x[1]"]),
        ("x[1..0]", []),
    ],
)
def test_members_of_a_key(key: str, names: list[str]) -> None:
    text = f'coordinates: ["{key}", y]\nparameters: {{N: 3}}\nT: y\'^2\n'
    text += f'initial: {{y: 0, "y\'": 0, "{key}": 1, "{key}\'": 2, }}'
    model = lagcli.load_text(text, "f.yaml")
    assert list(model.coordinate_names) == [*names, "y"]
    assert [model.initial_velocities[name].value for name in names] == [2.0] * len(names)


def test_brackets_need_no_quotes_in_lists_and_braces() -> None:
    model = load("definitions: {x[0]: 0, r[i = 1..N]: [x[i], x[i-1]], s: [x[1], y]}")
    x = se.symbols("x[1] x[2]")
    assert model.definitions["r[2]"].value.entries == (x[1], x[0])
    assert model.definitions["s"].value.entries == (x[0], se.Symbol("y"))


def test_coordinates_with_units_and_latex() -> None:
    model = load("coordinates: {x[1..N]: {unit: m, latex: '\\xi'}, y: {}}")
    assert [(c.unit, c.latex) for c in model.coordinates[:2]] == [
        ("m", r"\xi_{1}"),
        ("m", r"\xi_{2}"),
    ]


# sums


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("sum(x[i], i = 1..N)", "x[1] + x[2] + x[3]"),
        ("sum(i*x[i], i = 2..N)", "2*x[2] + 3*x[3]"),
        ("sum(x[i], i = 4..N)", "0"),
        ("sum(i^2, i = 1..10)", "385"),
        ("sum(sum(x[j], j = 1..i), i = 1..N)", "3*x[1] + 2*x[2] + x[3]"),
        ("sum(sum(x[i]*x[j], j = i + 1..N), i = 1..N)", "x[1]*x[2] + x[1]*x[3] + x[2]*x[3]"),
        ("sum(x[i] - x[i-1], i = 1..N)", "x[3]"),
        ("sum(1/(x[i] - x[1]), i = 2..N)", "(-x[1] + x[2])**(-1) + (-x[1] + x[3])**(-1)"),
        ("x[N - 1] + x[1]'", "x[2] + x[1]'"),
        ("x[1]_dot - x_dot[1]", "0"),
        ("l*sum(x[2*k - 1], k = 1..(N + 1)/2)", "l*(x[1] + x[3])"),
    ],
)
def test_sums(expression: str, expected: str) -> None:
    model = load(f'definitions: {{x[0]: 0, it: "{expression}"}}')
    found = model.definitions["it"].value
    names = {f"x[{i}]": se.Symbol(f"u{i}") for i in range(4)} | {"x[1]'": se.Symbol("w")}
    for name, symbol in names.items():
        expected = expected.replace(f"{name}'", "w").replace(name, symbol.name)
    plain = found.subs({se.Symbol(name): symbol for name, symbol in names.items()})
    # the expected text is this test's own
    assert se.expand(plain - se.sympify(expected)) == 0


def test_a_sum_of_vectors() -> None:
    model = load("definitions: {r[i = 1..N]: [x[i], i], R: 'sum(i*r[i], i = 1..2)'}")
    x = se.symbols("x[1] x[2]")
    assert model.definitions["R"].value.entries == (x[0] + 2 * x[1], 5)


# definitions


def test_definitions_by_index_refer_to_each_other_in_any_order() -> None:
    lines = "definitions: {u[i = 1..N]: v[i] + x[i], v[i = 1..N]: u[i-1]*2, u[0]: y, last: u[N]}"
    model = load(lines)
    x, y = se.symbols("x[1] x[2] x[3]"), se.Symbol("y")
    assert se.expand(model.definitions["last"].value - (8 * y + 4 * x[0] + 2 * x[1] + x[2])) == 0
    backwards = load("definitions: {b[i = 1..N]: b[i+1] + x[i], b[N+1]: 0}")
    assert backwards.definitions["b[1]"].value == sum(x)


@pytest.mark.parametrize("step", ["p[i-1] + x[i]", "p[i+1] + x[i]"])
def test_long_recursions(step: str) -> None:
    """Thousands of definitions that need each other, whichever end is known."""
    model = load(f"definitions: {{p[i = 1..N]: {step}, p[0]: 0, p[N+1]: 0}}", set={"N": 2000})
    ends = {model.definitions["p[1]"].value, model.definitions["p[2000]"].value}
    assert sum(se.Symbol(f"x[{i}]") for i in range(1, 2001)) in ends


# parameters


def test_parameters_by_index() -> None:
    model = load(
        "parameters: {N: 3, l: 2 m, m[i = 1..N]: i*l, m[2]: 7 kg, k[1..N]: [1 kN/m, 2 N/m, 3*l],"
        " c[0]: 1, c[i = 1..N]: c[i-1]/2, M: 'sum(m[i], i = 1..N)'}",
        set={"k[2]": "5 kN/m", "c[2]": 4},
    )
    values = model.parameter_values
    assert [values[f"m[{i}]"] for i in (1, 2, 3)] == [2.0, 7.0, 6.0]
    assert [values[f"k[{i}]"] for i in (1, 2, 3)] == [1000.0, 5000.0, 6.0]
    assert [values[f"c[{i}]"] for i in range(4)] == [1.0, 0.5, 4.0, 2.0]
    assert values["M"] == 15.0


def test_only_parameters_that_count_are_structural() -> None:
    parameters = "parameters: {K: 2, N: 'K + 1', l: 2 m, n: 2, m: 1, a[1..2]: [1, 2]}"
    model = load(parameters, "T: m*sum(x[i]'^2, i = 1..N)/N + n*x[n]'^2 + x[a[2]]'^2 + y'^2")
    assert model.structural_parameters == ("K", "N", "n", "a[1]", "a[2]")
    assert se.Symbol("N") in model.kinetic.free_symbols  # as a number it is a parameter like others
    assert load(parameters, set={"K": 6}).coordinate_names[-2:] == ("x[7]", "y")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("2.5", "`N` is used in an index and must be a whole number, but is 2.5"),
        ("-2", "the range 1..-2 is descending"),
        (MAX_MEMBERS + 1, "is too long"),
        ("1e300", "must be a whole number"),
        ("x", "`x`, which is a family"),
    ],
)
def test_numbers_of_members_that_are_none(given: object, message: str) -> None:
    found = complaints(set={"N": given})
    assert message in found[0]
    assert len(found) <= 3


def test_the_number_of_members_is_bounded_in_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(families, "MAX_ALL", 100)
    many = ", ".join(f"c{k}[1..30]: 1" for k in range(4))
    found = complaints(f"parameters: {{N: 1, {many}}}")
    assert len(found) == 1
    assert "families of this model have more than 100 members" in found[0]


def test_a_sum_of_too_many_terms() -> None:
    nested = "sum(sum(sum(x[1]*i*j*k, i = 1..N), j = 1..N), k = 1..N)"
    assert "more than 100,000 terms" in complaints(f"V: {nested}", set={"N": 100})[0]


# initial values


def test_a_single_initial_value_takes_precedence_over_a_range() -> None:
    model = load(
        "initial: {x[2]: 9, x[i = 1..N]: i*l, x_dot[1..N]: {guess: 1}, x[3]': 4 cm/s, y: 0, y': 0}",
        set_initial={"x[3]": 5, "x[1]'": 6, "x[2]_dot": 7},
    )
    positions, velocities = model.initial_positions, model.initial_velocities
    assert [positions[f"x[{i}]"].value for i in (1, 2, 3)] == [2.0, 9.0, 5.0]
    assert [velocities[f"x[{i}]"].value for i in (1, 2, 3)] == [6.0, 7.0, 0.04]
    assert [velocities[f"x[{i}]"].fixed for i in (1, 2, 3)] == [True, True, True]


@pytest.mark.parametrize("option", ["x[4]", "x", "x[1..2]", "x[1]''", "z[1]"])
def test_initial_values_of_what_is_not_there(option: str) -> None:
    assert "no initial value" in complaints(set_initial={option: 1})[0]


# constraints, forces, outputs


def test_constraints_forces_and_outputs_by_index() -> None:
    model = load(
        "constraints: {c[i = 1..N]: x[i] - x[i-1] = l, d[0]: y = x[N]'*0 + 1}",
        "Q: {x[i = 1..N]: -i*x[i]', y: 3}",
        "outputs: {f[i = 1..N]: lambda.c[i]*l + Qc.c[i].x[i] + Qc.x[i], z: lambda.d[0] + x[2]''}",
    )
    assert model.constraint_names == ("c[1]", "c[2]", "c[3]", "d[0]")
    v = se.Symbol("x[3]'")
    assert model.applied_forces["x[3]"] == -3 * v
    outputs = lagcli.derive(model).outputs
    lambdas = [se.Symbol(f"lambda.c[{i}]") for i in (1, 2, 3)]
    assert se.expand(outputs["f[2]"] - (lambdas[1] * (se.Symbol("l") + 2) - lambdas[2])) == 0
    assert list(outputs) == ["f[1]", "f[2]", "f[3]", "z"]


def test_an_error_in_a_family_is_reported_once_and_for_its_first_index() -> None:
    found = complaints(
        "constraints: {a[i = 1..N]: x[i-1]*x[i+1] = lenght, b[i = 1..N]: 1/(i - 2)*x[i] = 0,"
        " e[i = 1..N]: x[i+1]*x[i+2] = 0, u[i = 1..N]: y = 1}",
        set={"N": 50},
    )
    assert len(found) == 5
    assert "`x[51]` for i = 50, but there is only `x[0..50]`" in found[0]
    assert "`lenght`" in found[1]
    assert "division by zero, for i = 2" in found[2]
    assert "`x[51]` for i = 49" in found[3]
    assert "the same for every index" in found[4]


# scale


def test_cost_is_linear() -> None:
    """Ten times the bodies take about ten times as long; a quadratic step would show as hundred."""
    path = MODELS / "chain.yaml"

    def seconds(n: int) -> float:
        began = time.process_time()
        lagcli.derive(lagcli.load(path, set={"N": n}))
        return time.process_time() - began

    assert_growth(seconds, (100, 1000), factor=20)


def test_sparse() -> None:
    equations = lagcli.derive(lagcli.load(MODELS / "chain.yaml", set={"N": 300}))
    assert sum(map(len, equations.mass_matrix)) == 600
    assert sum(len(c.row) for c in equations.constraints) == 4 * 300 - 2


#: Models that declare a name, and use it.
DECLARED = {
    "coordinate": "coordinates: [z, {0}]\nT: (z'^2 + {0}'^2)/2\ninitial: {{{0}: 0, {0}': 0, ",
    "parameter": "coordinates: [z]\nparameters: {{{0}: 1}}\nT: {0}*z'^2/2\ninitial: {{",
    "definition": "coordinates: [z]\ndefinitions: {{{0}: z}}\nT: {0}'^2/2\ninitial: {{",
    "constraint": "coordinates: [z]\nT: z'^2/2\nconstraints: {{{0}: z = 0}}\ninitial: {{",
    "output": "coordinates: [z]\nT: z'^2/2\noutputs: {{{0}: z}}\ninitial: {{",
    "point": "coordinates: {{z: m, {0}: point}}\nT: (z'^2 + norm({0}')^2)/2\n"
    "initial: {{{0}: 0, {0}': 0, ",
}
#: As the table in `docs/model-file.md`: what cannot have a name.
REFUSED = {
    **{x: {*DECLARED} for x in ("and", "or", "not", "if")},
    "t": DECLARED.keys() - {"constraint"},
    "pi": DECLARED.keys() - {"constraint", "output"},
    **{x: {"output"} for x in ("time", "z_dot", *(q.name for q in SCALARS))},
    **{x: {"point"} for x in ("lambda", "Qc")},
}
FREE = (
    *FUNCTIONS,
    *"TVLDQNEISgms",
    "sum",
    "dot",
    "body",
    "kg",
    "N",
    "event",
    "guess",
    "multipliers",
)


@pytest.mark.parametrize("name", [*REFUSED, *FREE])
def test_reserved_names_are_those_of_the_documentation(name: str) -> None:
    kinds = {"output"} if name == "z_dot" else DECLARED.keys()
    assert {x for x in kinds if is_refused(x, name)} == REFUSED.get(name, set())


def is_refused(kind: str, name: str) -> bool:
    """Whether a name is refused for a kind of quantity, as a name."""
    try:
        lagcli.load_text((DECLARED[kind] + "z: 0, z': 0}}").format(name))
    except ModelError as error:
        if "-name" not in error.diagnostics[0].kind:
            raise
        return True
    return False
