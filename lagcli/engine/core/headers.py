"""Headers of the core that are generated from Python modules.

The build writes them before it compiles the core, so this module imports only the standard
library.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from enum import IntEnum
from functools import partial

from lagcli.engine.core.settings import CORE_SETTINGS, c_type
from lagcli.engine.core.status import LaneStatus, StartStatus, Status
from lagcli.engine.layout import Layout, RatesLayout, SampleLayout, UnrolledLayout
from lagcli.engine.tape.operations import (
    ARITY,
    INDEXED,
    LINE,
    LONGEST,
    MAX_ORDER,
    NODE_VALUES,
    PLACES,
    ROUNDING,
    SHORTEST,
    VECTOR,
    Kind,
    Op,
)
from lagcli.engine.tape.series_operations import LONGEST as MAX_LENGTH
from lagcli.engine.tape.series_operations import SeriesOp

_WRITTEN = "/* Written by the build from {}: change that instead.\n *\n"
_TABLES = """\
 * The lists of operations are macros of a macro X(operation, places, value): the numbers that an
 * operation has in a stream, and its value in C of operands A, B and C.
 *
 * The functions are a macro of X(operation, value, enclosure, low, high, slope): the value of A,
 * the function that encloses it on an interval, the ends of its domain, and the derivative as jets
 * of A and of the value, C, by add, sub, mul, div, sqr (the square) and functions, up to order n.
 * The domains are one of X(operation, condition): whether nothing in an interval A has a value. */
#ifndef LAGCLI_TABLES_H
#define LAGCLI_TABLES_H

{parts}
#endif
"""
_LAYOUT = """\
 * The first place of each part. */
#ifndef LAGCLI_LAYOUT_H
#define LAGCLI_LAYOUT_H

{parts}
#endif
"""
_SETTINGS = """\
 * The settings that the core uses. Choices are enumerations; a number that is not given is NaN.
 *
 * They are listed as LAG_SETTINGS(REAL, COUNT, CHOICE) by their kinds: REAL(name), COUNT(name), and
 * CHOICE(name, how many there are). */
#ifndef LAGCLI_SETTINGS_H
#define LAGCLI_SETTINGS_H

#include <stdint.h>

{parts}
#endif
"""
#: Prefixes of the functions of layouts.
_PREFIXES: dict[str, type[Layout]] = {
    "lag_sample_": SampleLayout,
    "lag_first_": UnrolledLayout,
    "lag_constraint_": RatesLayout,
}


def headers() -> dict[str, str]:
    """Return the texts of the headers by the names of their files."""
    return {
        "tables.h": _WRITTEN.format("the tables that lagcli/engine/core/headers.py reads")
        + _tables(),
        "layout.h": _WRITTEN.format("lagcli/engine/layout.py") + _layouts(),
        "settings.h": _WRITTEN.format("lagcli/settings/settings.py") + _settings(),
    }


def _settings() -> str:
    parts, rows, fields = [], [], []
    for name, setting in CORE_SETTINGS.items():
        kind = c_type(setting)
        fields.append(f"    {kind} {name}; /* {setting.help} */")
        if kind == "int":
            rows.append(f"    CHOICE({name}, {len(setting.choices) or 2})")
        else:
            rows.append(f"    {'REAL' if kind == 'double' else 'COUNT'}({name})")
        if setting.choices:
            words = ", ".join(f"LAG_{word.upper()}" for word in setting.choices)
            parts.append(f"enum lag_{name} {{ {words} }};\n")
    parts.append("\n".join(["typedef struct {", *fields, "} lag_settings;\n"]))
    parts.append(" \\\n".join(["#define LAG_SETTINGS(REAL, COUNT, CHOICE)", *rows]) + "\n")
    return _SETTINGS.format(parts="\n".join(parts))


def _layouts() -> str:
    parts = []
    for prefix, layout in _PREFIXES.items():
        terms: list[str] = []
        for name, counts in layout.parts().items():
            parts.append(_offset(prefix + name, terms))
            terms += (count if count == "1" else f"s->{count}" for count in counts)
        if all(layout.parts().values()):
            parts.append(_offset(prefix + "size", terms))
    return _LAYOUT.format(parts="\n".join(parts))


def _offset(name: str, terms: Iterable[str]) -> str:
    body = f"    (void)s;\n    return {' + '.join(terms) or '0'};"
    return f"static inline int {name}(const lag_system *s)\n{{\n{body}\n}}\n"


def _tables() -> str:
    parts = [
        _enum("lag_op", "OP_", Op),
        _define("LAG_PLACES", _list(PLACES)),
        _define("LAG_ARITY", _list(ARITY)),
        _define("LAG_CLIPPED", f"{ROUNDING * ROUNDING!r} /* of the square, what CLIP ignores */"),
        _define("LAG_VECTOR", f"{VECTOR} /* added to an operation: on vectors */"),
        _define("LAG_LONGEST", f"{LONGEST} /* elements that a vector has at most */"),
        _define("LAG_SHORTEST", f"{SHORTEST} /* elements of a vector at least */"),
        _define("LAG_NODE_VALUES", f"{NODE_VALUES} /* results and operands at most */"),
        _define("LAG_LINE", f"{LINE} /* registers of a cache line */"),
        _define("LAG_INDEXED", f"({1 + INDEXED} - 1) /* the step of operands that are listed */"),
        *(_operations(kind) for kind in (Kind.LIBRARY, Kind.RELATION, Kind.BATCH, Kind.VECTOR)),
        _functions(),
        _enum("lag_series_op", "SERIES_", SeriesOp),
        *(_define(f"SERIES_{op.name}_PLACES", str(1 + len(op.operands))) for op in SeriesOp),
        _define("LAG_SERIES_ORDER", f"{MAX_ORDER} /* the largest */"),
        _define("LAG_SERIES_LONGEST", f"{MAX_LENGTH} /* elements that a vector has at most */"),
        _define("LAG_SERIES_OPERANDS", _list(len(op.operands) for op in SeriesOp)),
        _enum("lag_status", "LAG_", Status, (s.sentence for s in Status)),
        _enum("lag_lane_status", "LAG_LANE_", LaneStatus, (s.sentence for s in LaneStatus)),
        _enum("lag_start_status", "LAG_START_", StartStatus, (s.sentence for s in StartStatus)),
    ]
    return _TABLES.format(parts="\n".join(parts))


def _enum(
    name: str, prefix: str, members: type[IntEnum], comments: Iterable[str] | None = None
) -> str:
    """Return an enumeration; the comments are those of its members."""
    names = [f"    {prefix}{member.name}," for member in members]
    if comments is not None:
        names = [f"{line} /* {comment} */" for line, comment in zip(names, comments, strict=True)]
    return "\n".join([f"enum {name} {{", *names, "};\n"])


def _define(name: str, text: str) -> str:
    return f"#define {name} {text}\n"


def _list(numbers: Iterable[int]) -> str:
    return f"{{{', '.join(map(str, numbers))}}}"


def _operations(kind: Kind) -> str:
    """Return the list of the operations of a kind."""
    rows = [f"    X(OP_{op.name}, {PLACES[op]}, {op.c})" for op in Op if op.kind is kind]
    return " \\\n".join([f"#define LAG_{kind.name}_OPERATIONS(X)", *rows]) + "\n"


def _functions() -> str:
    """Return the lists of the functions that jets follow from, and of the ends of domains."""
    rows, domains = [], []
    for op in Op:
        function = op.function
        if function is None:
            continue
        low, high, is_open, _ = function.domain
        if function.enclosure:
            assert function.slope is not None
            slope = function.slope(_JetFunctions(), _Jet("A"), _Jet("C")).text
            bounds = f"{_number(low)}, {_number(high)}"
            rows.append(f"    X(OP_{op.name}, {op.c}, {function.enclosure}, {bounds}, {slope})")
        equal = "=" if is_open else ""
        conditions = [f"A.high <{equal} {_number(low)}"] * (low > -math.inf)
        conditions += [f"A.low >{equal} {_number(high)}"] * (high < math.inf)
        if conditions:
            domains.append(f"    X(OP_{op.name}, {' || '.join(conditions)})")
    return "\n".join(
        " \\\n".join([f"#define {name}(X)", *lines]) + "\n"
        for name, lines in (("LAG_FUNCTIONS", rows), ("LAG_DOMAINS", domains))
    )


def _number(x: float) -> str:
    return repr(x) if math.isfinite(x) else f"{'-' if x < 0 else ''}INFINITY"


class _Jet:
    """A jet in C, with the operators of arithmetic."""

    def __init__(self, text: str):
        self.text = text

    @staticmethod
    def of(name: str, *operands: _Jet | float) -> _Jet:
        """Return the jet that a function of C returns."""
        texts = [x.text if isinstance(x, _Jet) else f"constant({x!r})" for x in operands]
        return _Jet(f"{name}({', '.join(texts)}, n)")

    def __neg__(self) -> _Jet:
        return self.of("sub", 0.0, self)

    def __add__(self, other: _Jet | float) -> _Jet:
        return self.of("add", self, other)

    def __radd__(self, other: float) -> _Jet:
        return self.of("add", other, self)

    def __sub__(self, other: _Jet | float) -> _Jet:
        return self.of("sub", self, other)

    def __rsub__(self, other: float) -> _Jet:
        return self.of("sub", other, self)

    def __mul__(self, other: _Jet | float) -> _Jet:
        if isinstance(other, _Jet) and other.text == self.text:
            return self.of("sqr", self)
        return self.of("mul", self, other)

    def __rmul__(self, other: float) -> _Jet:
        return self.of("mul", other, self)

    def __truediv__(self, other: _Jet | float) -> _Jet:
        return self.of("div", self, other)

    def __rtruediv__(self, other: float) -> _Jet:
        return self.of("div", other, self)


class _JetFunctions:
    """Functions of jets in C, by their names."""

    def __getattr__(self, name: str) -> Callable[[_Jet], _Jet]:
        return partial(_Jet.of, f"jet_{name}")
