"""Mass matrix and forces of the terms of a Lagrangian that are quadratic in the velocities.

Most kinetic energies are sums of terms c u w, where u and w are affine in the velocities:

    w = Σ_j w_j v_j + w_0,  with the convective rate ẇ = Σ_ij ∂_j w_i v_i v_j + … .

Such a term gives M_ij = c (u_i w_j + u_j w_i), and of ∂L/∂q_i − (∂p_i/∂q) v − ∂p_i/∂t

    c (u e_i(w) + w e_i(u) − u_i ẇ − w_i u̇) + ∂_i c u w − ċ (u_i w + w_i u),

    e_i(w) = ∂w/∂q_i − dw_i/dt = Σ_j (∂_i w_j − ∂_j w_i) v_j + ∂_i w_0 − ∂_t w_i.

If w is the derivative of a position, e vanishes identically and is not built; for a rotation it
gives the gyroscopic terms. Differentiating L directly would build both parts of e and leave their
cancellation to floating-point arithmetic.

Terms with the same w_i and c are summed once: the velocities of a chain's links are nested sums,
and few distinct sets of links depend on coordinates i and j.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.motion import ONE, TWO, ZERO, Motion, addends
from lagcli.model.expression.algebra import kinked_in

#: Least number of terms of a sum in a product that is distributed although the product is a term of
#: −V: each derivative of the product would differentiate all of them. Shorter ones keep their form.
_LONG = 24


class AffineForm(NamedTuple):
    """An expression affine in the velocities, w = Σ_j w_j v_j + w_0.

    Parameters
    ----------
    value : expression
        w.
    row : dict of int to expression
        The w_j by coordinate.
    offset : expression
        w_0.
    rate : expression
        ẇ without accelerations.
    curl : dict of int to expression
        The nonzero e_i.
    """

    value: Basic
    row: dict[int, Basic]
    offset: Basic
    rate: Basic
    curl: dict[int, Basic]


class QuadraticTerm(NamedTuple):
    """A term c u w of the Lagrangian."""

    factor: Basic
    first: AffineForm
    second: AffineForm


class QuadraticForms:
    """Recognizes affine forms and their products.

    Parameters
    ----------
    motion : Motion
    """

    def __init__(self, motion: Motion):
        self.motion = motion
        self._known: dict[Basic, AffineForm | None] = {}

    def split(self, expression: Basic) -> tuple[list[QuadraticTerm], list[Basic]]:
        """Split an expression into terms c u w and all others."""
        terms: list[QuadraticTerm] = []
        rest: list[Basic] = []
        stack = [expression]
        while stack:
            part = stack.pop()
            if isinstance(part, se.Add):
                stack.extend(reversed(part.args))
                continue
            constant, moving = self._factors(part)
            if len(moving) == 1 and isinstance(moving[0], se.Add):
                factor = se.Mul(*constant)
                stack.extend(factor * x for x in reversed(moving[0].args))
                continue
            forms = list(map(self.form, moving)) if len(moving) == 2 else [None]
            first, second = forms[0], forms[-1]
            if first is None or second is None:
                for term in addends(part):
                    rest.extend(addends(term, _LONG))
            else:
                terms.append(QuadraticTerm(se.Mul(*constant), first, second))
        return terms, rest

    def _factors(self, expression: Basic) -> tuple[list[Basic], list[Basic]]:
        """Split a term into factors without and with velocities; squares count twice."""
        constant: list[Basic] = []
        moving: list[Basic] = []
        for factor in expression.args if isinstance(expression, se.Mul) else (expression,):
            if not self.motion.occurring(factor).rates:
                constant.append(factor)
            elif isinstance(factor, se.Pow) and factor.args[1] == TWO:
                moving += [factor.args[0]] * 2
            else:
                moving.append(factor)
        return constant, moving

    def form(self, expression: Basic) -> AffineForm | None:
        """Return an expression as an affine form; None if it is not affine in the velocities."""
        if expression not in self._known:
            self._known[expression] = self._form(expression)
        return self._known[expression]

    def _form(self, expression: Basic) -> AffineForm | None:
        rows: dict[int, list[Basic]] = {}
        offsets: list[Basic] = []
        for term in addends(expression):
            parts = self._split(term)
            if parts is None:
                return None
            for j, coefficient in parts[0].items():
                rows.setdefault(j, []).append(coefficient)
            offsets.append(parts[1])
        row = {j: se.Add(*rows[j]) for j in sorted(rows)}
        row = {j: x for j, x in row.items() if x != ZERO}
        return self._with_rate(expression, row, se.Add(*offsets))

    def difference(self, form: AffineForm, other: AffineForm) -> AffineForm:
        """Return a form less another one."""
        both = {j: form.row.get(j, ZERO) - other.row.get(j, ZERO) for j in {*form.row, *other.row}}
        row = {j: x for j, x in sorted(both.items()) if x != ZERO}
        offset = form.offset - other.offset
        value = se.Add(*[x * self.motion.v[j] for j, x in row.items()], offset)
        return self._with_rate(value, row, offset)

    def _with_rate(self, value: Basic, row: dict[int, Basic], offset: Basic) -> AffineForm:
        """Return the form of a value, its coefficients and offset."""
        rate, curl = self._rate(row, offset)
        return AffineForm(value, row, offset, rate, curl)

    def _split(self, term: Basic) -> tuple[dict[int, Basic], Basic] | None:
        """Split a term into coefficients of velocities and the rest."""
        motion = self.motion
        rates = motion.occurring(term).rates
        if not rates:
            return {}, term
        if len(rates) == 1:
            v = motion.v[rates[0]]
            if term == v:
                return {rates[0]: ONE}, ZERO
            if isinstance(term, se.Mul) and v in term.args:
                coefficient = se.Mul(*[x for x in term.args if x != v])
                if not motion.occurring(coefficient).rates:
                    return {rates[0]: coefficient}, ZERO
        slopes = {j: motion.diff(term, motion.v[j]) for j in rates}
        if any(motion.occurring(x).rates for x in slopes.values()):
            return None
        if not motion.smooth and kinked_in(term, [motion.v[j] for j in rates]) is not None:
            return None
        return slopes, term.xreplace({motion.v[j]: ZERO for j in rates})

    def _rate(self, row: dict[int, Basic], offset: Basic) -> tuple[Basic, dict[int, Basic]]:
        """Return ẇ without accelerations, and the nonzero e_i."""
        motion, v = self.motion, self.motion.v
        by_time = motion.slopes(offset)
        terms: list[Basic] = [by_time.by_time]
        curl: dict[int, list[Basic]] = {}

        def add(i: int, difference: Basic, times: Basic) -> None:
            if difference != ZERO and (difference := se.expand(difference)) != ZERO:
                curl.setdefault(i, []).append(difference * times)

        for i, coefficient in row.items():
            slopes = motion.slopes(coefficient)
            terms.append(slopes.by_time * v[i])
            add(i, by_time.by_position.get(i, ZERO) - slopes.by_time, ONE)
            for j, here in slopes.by_position.items():
                there = motion.slopes(row[j]).by_position.get(i, ZERO) if j in row else ZERO
                if i == j:
                    terms.append(here * v[i] ** TWO)
                elif here == there:
                    terms.append((here + there) * v[i] * v[j] if i < j else ZERO)
                else:
                    terms.append(here * v[i] * v[j])
                    add(i, there - here, v[j])
                    if there == ZERO:
                        add(j, here, v[i])
        for j, slope in by_time.by_position.items():
            terms.append(slope * v[j])
            if j not in row:
                add(j, slope, ONE)
        sums = {i: se.Add(*curls) for i, curls in curl.items()}
        return se.Add(*terms), {i: x for i, x in sums.items() if x != ZERO}


class QuadraticPart:
    """The sum of the terms c u w of a Lagrangian.

    Parameters
    ----------
    terms : iterable of QuadraticTerm
    motion : Motion
    """

    def __init__(self, terms: Iterable[QuadraticTerm], motion: Motion):
        self.motion = motion
        self.terms = tuple(terms)
        k = len(motion.q)
        self.squares: list[tuple[Basic, AffineForm]] = []
        self.products: list[QuadraticTerm] = []
        for term in self.terms:
            if term.first is term.second:
                self.squares.append((TWO * term.factor, term.first))
            else:
                self.products.append(term)
        # for each coordinate: its coefficients, and the squares in which they occur
        self.columns: list[dict[Basic, int]] = [{} for _ in range(k)]
        self.partners = [
            0
        ] * k  # bits: the coordinates that occur in a square together with this one
        for index, (_, form) in enumerate(self.squares):
            known = sum(1 << j for j in form.row)
            for j, coefficient in form.row.items():
                column = self.columns[j]
                column[coefficient] = column.get(coefficient, 0) | 1 << index
                self.partners[j] |= known
        self._factors: dict[int, Basic] = {}
        self._forces: dict[int, Basic] = {}

    def mass_matrix(self) -> list[dict[int, Basic]]:
        """Return the contributions to M by row and column."""
        rows: list[dict[int, Basic]] = [{} for _ in self.columns]
        for i, column in enumerate(self.columns):
            for j in _bits(self.partners[i] >> i):
                entry = self._entry(column, self.columns[i + j])
                if entry != ZERO:
                    rows[i][i + j] = rows[i + j][i] = entry
        for term in self.products:
            u, w = term.first.row, term.second.row
            for i in {*u, *w}:
                for j in {*u, *w}:
                    both = u.get(i, ZERO) * w.get(j, ZERO) + u.get(j, ZERO) * w.get(i, ZERO)
                    if both != ZERO:
                        rows[i][j] = rows[i].get(j, ZERO) + term.factor * both
        return rows

    def _entry(self, column: dict[Basic, int], other: dict[Basic, int]) -> Basic:
        """Return Σ c w_i w_j over the squares in which both coordinates occur."""
        terms_of: dict[Basic, list[Basic]] = {}
        for x, here in column.items():
            for y, there in other.items():
                if here & there:
                    terms_of.setdefault(self._factor(here & there), []).append(x * y)
        return se.Add(*[c * se.Add(*products) for c, products in terms_of.items()])

    def _factor(self, mask: int) -> Basic:
        """Return the sum of the factors of some squares."""
        if mask not in self._factors:
            self._factors[mask] = se.Add(*[self.squares[k][0] for k in _bits(mask)])
        return self._factors[mask]

    def forces(self) -> list[list[Basic]]:
        """Return the contributions to ∂L/∂q_i − (∂p_i/∂q) v − ∂p_i/∂t, as lists of terms."""
        forces: list[list[Basic]] = [[] for _ in self.columns]
        for i, column in enumerate(self.columns):
            for coefficient, mask in column.items():
                forces[i].append(-coefficient * self._force(mask))
        for factor, form in self.squares:
            for i, curl in form.curl.items():
                forces[i].append(factor * form.value * curl)
            self._varying(forces, factor / TWO, form, form)
        for term in self.products:
            u, w, c = term.first, term.second, term.factor
            for a, b in ((u, w), (w, u)):
                for i, curl in b.curl.items():
                    forces[i].append(c * a.value * curl)
                for i, coefficient in a.row.items():
                    forces[i].append(-c * coefficient * b.rate)
            self._varying(forces, c, u, w)
        return forces

    def _force(self, mask: int) -> Basic:
        """Return the sum of c ẇ over some squares."""
        if mask not in self._forces:
            chosen = (self.squares[k] for k in _bits(mask))
            self._forces[mask] = se.Add(*[c * form.rate for c, form in chosen])
        return self._forces[mask]

    def _varying(self, forces: list[list[Basic]], c: Basic, u: AffineForm, w: AffineForm) -> None:
        """Add the contributions of a factor that depends on q or t."""
        slopes = self.motion.slopes(c)
        for i, slope in slopes.by_position.items():
            forces[i].append(slope * u.value * w.value)
        rate = self.motion.convective(c)
        if rate != ZERO:
            for i in sorted({*u.row, *w.row}):
                both = u.row.get(i, ZERO) * w.value + w.row.get(i, ZERO) * u.value
                forces[i].append(-rate * both)

    @property
    def homogeneous(self) -> bool:
        """Whether the terms are homogeneous of second degree in the velocities."""
        return all(f.offset == ZERO for term in self.terms for f in (term.first, term.second))

    def energy(self) -> Basic:
        """Return v·p − L of these terms, c [(u − u_0)(w − w_0) − u_0 w_0]."""
        terms = []
        for term in self.terms:
            u, w, c = term.first, term.second, term.factor
            if u.offset == ZERO and w.offset == ZERO:
                terms.append(c * u.value * w.value)
            else:
                left, right = u.value - u.offset, w.value - w.offset
                terms.append(c * (left * right - u.offset * w.offset))
        return se.Add(*terms)


def _bits(number: int) -> Iterable[int]:
    """Yield the positions of the set bits of an integer."""
    while number:
        lowest = number & -number
        yield lowest.bit_length() - 1
        number ^= lowest
