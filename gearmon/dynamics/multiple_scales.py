"""Multiple scales: the orders of the steady vibration, in closed form.

With the damping kept in the zeroth-order operator the free vibration dies out on the fast scale
and every order of the steady state is forced. Putting phi(t) = eps f(t) and z = z^(0) + eps z^(1)
+ ...,

    z^(k+1)'' + 2 zeta w0 z^(k+1)' + w0^2 z^(k+1) = -w0^2 f z^(k)
    Z^(0)_n = g_n/D_n,      Z^(k+1)_n = -(1/D_n) sum_m phi_{n-m} Z^(k)_m
    D_n = 1 - (n/R)^2 + 2 i zeta n/R

with eps absorbed in phi and g = (F, f_1, ...)/k0. So stiffness harmonic j makes, at first order,
line j of size |c_j| F/(k0 |D_j|); lines n = j + l follow at second order, and so on. The series
converges if max|phi| max 1/|D_n| < 1 and may converge or not beyond. Order k reaches harmonics
0..kJ, or is cut at `highest`.

The textbook form for vanishing damping (Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5)
has h = zeta w0 = eps mu, so that damping acts one order later:

    Z^(k+1)_n = -(1/D_n) [sum_m phi_{n-m} Z^(k)_m + 2 i zeta (n/R) Z^(k)_n],   D_n = 1 - (n/R)^2

It is offered as `small_damping`. It diverges where 2 zeta n/R > |D_n|, that is near resonance,
where n w = w0 makes the right side secular: there use `forced_resonance`. The damping
ratio of meshes (0.03 to 0.3) is not small beside the variation of stiffness, which is why it is in
order zero by default. Transients are in `motion`.

Mass, damping, mean stiffness and period enter through D_n alone, the size of the variation through
its power and the force as a factor: other values are substituted in the same orders.

Where a line comes from. Order k of line n is a sum over paths: start at a line s that a force
drives, take k steps by stiffness harmonics j_1, ..., j_k (negative for the conjugate) with
s + j_1 + ... + j_k = n, and gain 1/D at every line on the way:

    Z^(k)_n = (-1)^k sum_paths (f_s/k0)/D_s * c_{j1}/D_{s+j1} * c_{j2}/D_{s+j1+j2} ... c_{jk}/D_n

So line 3 at order 2 is made of c_1 c_2 (over line 1 or line 2), c_4 conj(c_1), and so on. Where
damping is small it takes steps, too: from a line to itself with 2 i zeta n/R in place of c_j.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import FEWEST_FOR_A_MATRIX, Complex, Modulation, Real
from gearmon.dynamics.hill import UNITS, HillProblem, broadcast_values, dynamic_stiffness
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result

#: |D_n| that is rounding only
NO_STIFFNESS = 1e-13
#: Complex numbers of one array while formulas are evaluated: a few such stay in the cache.
VALUES_AT_ONCE = 1 << 17


@dataclass(frozen=True, kw_only=True)
class Expansion(Result):
    """The orders of one steady state.

    Attributes
    ----------
    problem : HillProblem
        What was expanded.
    terms : complex ndarray, shape (order+1, N+1)
        Z^(k)_n [m] with the powers of the stiffness variation included; their sum approximates z_n.
    small_damping : bool
        Whether damping counts as order one.
    """

    problem: HillProblem
    terms: Complex
    small_damping: bool = False

    @property
    def order(self) -> int:
        """Highest order."""
        return len(self.terms) - 1

    @property
    def displacement(self) -> Complex:
        """Sum of all orders [m], shape (N+1,)."""
        return np.asarray(self.terms.sum(axis=0))

    @cached_property
    def _products(self) -> tuple[Modulation, Modulation]:
        """Product by k(t) of few sets and of many."""
        c, highest = self.problem.stiffness_harmonics, self.terms.shape[1] - 1
        one, many = (Modulation(c, highest, highest, sets) for sets in (1, 1000))
        return one, many

    def substitute(self, *, variation: npt.ArrayLike = 1.0, **values: npt.ArrayLike) -> Complex:
        """Displacement for other parameter values, which broadcast against each other.

        Accurate where the series converges (max|phi| max 1/|D_n| below about 0.5 for order 10 and
        1e-3); no error bound: `sweep` bounds the errors.

        Parameters
        ----------
        variation : float array
            Factor >= 0 of every c_j.
        **values
            mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n : float array, as in
            `HillProblem`; by default the problem's own.

        Returns
        -------
        complex ndarray, shape (..., N+1)
            z_0..z_N [m] of every set.

        Raises
        ------
        ArgumentError
            If a value is not finite or out of its range, or the shapes do not broadcast.
        """
        own = {name: getattr(self.problem, name) for name in UNITS if name != "scale"}
        sets = broadcast_values(own | values | {"scale": variation})
        flat = np.array([sets[name].ravel() for name in UNITS])
        count = self.terms.shape[1]
        found = np.empty((flat.shape[1], count), dtype=complex)
        rows = max(1, VALUES_AT_ONCE // count)
        for first in range(0, len(found), rows):
            found[first : first + rows] = self._sum(flat[:, first : first + rows, None])
        return found.reshape(*sets["scale"].shape, count)

    def _sum(self, sets: Real) -> Complex:
        """All orders for sets of shape (6, B, 1)."""
        mass, damping, stiffness, period, force, scale = sets
        root, highest = np.sqrt(stiffness * mass), self.terms.shape[1] - 1
        ratio, zeta = root / mass * period / (2 * math.pi), damping / (2 * root)
        # the force harmonics are not substituted
        forcing = np.tile(self.problem.static_forcing(highest), (len(force), 1))
        forcing *= self.problem.stiffness_n_per_m
        forcing[:, :1] = force
        zeroth = Zeroth.of(ratio, zeta, highest, self.small_damping)
        product = self._products[len(force) >= FEWEST_FOR_A_MATRIX]
        terms = _orders(zeroth, forcing / stiffness, lambda half: scale * product(half))
        return np.asarray(sum(itertools.islice(terms, self.order + 1)))


def expand(
    problem: HillProblem, order: int, highest: int | None = None, small_damping: bool = False
) -> Expansion:
    """Orders 0..`order` of the steady vibration.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    order : int
        Highest order, >= 0.
    highest : int, optional
        Highest harmonic kept, >= 1; by default every harmonic that these orders reach.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero.

    Returns
    -------
    Expansion

    Raises
    ------
    ArgumentError
        If order or highest is out of its range, or if in the zeroth order a harmonic lies undamped
        on the natural frequency.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> first = expand(p, 1).terms[1]     # line 1: F/k0 * c_1 / |D_1|
    >>> bool(abs(abs(first[1]) - 5e-6 * 0.065 / abs(p.dynamic_stiffness(1)[1])) < 1e-18)
    True
    """
    check_range("order", order, 0, 10_000)
    if highest is None:
        forced = len(problem.force_harmonics_n)
        highest = max(1, forced + order * len(problem.stiffness_harmonics))
    check_range("highest", highest, 1, 10_000_000)
    zeroth = Zeroth.of(problem.frequency_ratio, problem.damping_ratio, highest, small_damping)
    modulate = Modulation(problem.stiffness_harmonics, highest, highest)
    stream = _orders(zeroth, problem.static_forcing(highest), modulate)
    terms = np.array(list(itertools.islice(stream, order + 1)))
    return Expansion(problem=problem, terms=terms, small_damping=small_damping)


class Zeroth(NamedTuple):
    """What acts in order zero on every line, and what is left to the next.

    Attributes
    ----------
    compliance : complex ndarray, shape (..., N+1)
        1/D_n.
    damping : complex ndarray, shape (..., N+1)
        2 i zeta n/R where damping is small, else zeros.
    """

    compliance: Complex
    damping: Complex

    @classmethod
    def of(cls, ratio: Real | float, zeta: Real | float, highest: int, small: bool) -> Zeroth:
        """Of R and zeta, or of columns of them; ArgumentError where a |D_n| is rounding only."""
        stiffness = dynamic_stiffness(ratio, zeta, highest)
        damping = np.asarray(1j * stiffness.imag * small, dtype=np.complex128)
        stiffness -= damping
        if np.abs(stiffness).min() < NO_STIFFNESS:
            n = int(np.abs(stiffness).argmin()) % stiffness.shape[-1]
            raise ArgumentError(
                f"harmonic {n} lies on the natural frequency and has no damping in order zero: its "
                f"terms are secular; use forced_resonance(problem, lines=[{n}])"
            )
        return cls(1 / stiffness, damping)


def _orders(
    zeroth: Zeroth, forcing: Complex, modulate: Callable[[Complex], Complex]
) -> Iterator[Complex]:
    """Yield Z^(0), Z^(1), ... [m] without end, of one or many systems, shape (..., N+1)."""
    term = forcing * zeroth.compliance
    while True:
        yield term
        term = -(modulate(term) + zeroth.damping * term) * zeroth.compliance


MOST_PATHS = 200_000


@dataclass(frozen=True)
class Path:
    """One term of one order of one line.

    Attributes
    ----------
    lines : tuple of int
        s, ..., n: the lines on the way, negative for conjugates.
    steps : tuple of int
        j_1..j_k; 0 is a step of small damping.
    gains : tuple of complex
        1/D of every line in `lines`.
    contribution : complex
        What it adds to Z^(k)_n [m].
    """

    lines: tuple[int, ...]
    steps: tuple[int, ...]
    gains: tuple[complex, ...]
    contribution: complex

    @property
    def order(self) -> int:
        """Number of steps."""
        return len(self.steps)

    @property
    def text(self) -> str:
        """The term as a formula.

        Examples
        --------
        >>> Path(lines=(0, 1, 3), steps=(1, 2), gains=(1, 1, 1), contribution=1).text
        '(F/k0) (c_1/D_1) (c_2/D_3)'
        """
        sign = "-" if self.order % 2 else ""
        start = self.lines[0]
        factors = ["(F/k0)" if start == 0 else f"({_named('f', start)}/k0/D_{start})"]
        for j, n in zip(self.steps, self.lines[1:], strict=True):
            factors.append(f"({_named('c', j) if j else '2i zeta n/R'}/D_{n})")
        return sign + " ".join(factors)

    def extended(self, line: int, step: int, factor: complex, gain: complex) -> Path:
        """Return the path with one more step, whose weight is -factor."""
        made = -factor * self.contribution
        return Path((*self.lines, line), (*self.steps, step), (*self.gains, gain), made)


def _named(letter: str, number: int) -> str:
    return f"{letter}_{number}" if number > 0 else f"conj {letter}_{-number}"


def paths(expansion: Expansion, line: int, order: int, most: int | None = None) -> list[Path]:
    """Terms that make up one order of one line, the largest first.

    Parameters
    ----------
    expansion : Expansion
        From `expand`, of any order.
    line : int
        n >= 0.
    order : int
        k, 0 to the order of the expansion.
    most : int, optional
        Number of terms wanted, >= 1: exactly the largest ones. By default all of them, which then
        sum to `expansion.terms[order, line]`.

    Returns
    -------
    list of Path
        By modulus of the contribution.

    Raises
    ------
    ArgumentError
        If line or order lies outside the expansion, or all terms are asked for and there are more
        than 200,000 on the way.

    Examples
    --------
    >>> from gearmon.dynamics import HillProblem
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065, 0.02], 1.6e-3, 4e3)
    >>> for path in paths(expand(p, 2), 3, 2):
    ...     print(path.text)
    (F/k0) (c_2/D_2) (c_1/D_3)
    (F/k0) (c_1/D_1) (c_2/D_3)
    """
    highest = expansion.terms.shape[1] - 1
    check_range("order", order, 0, expansion.order)
    check_range("line", line, 0, highest)
    if most is not None:
        check_range("most", most, 1, MOST_PATHS)
    p = expansion.problem
    zeroth = Zeroth.of(p.frequency_ratio, p.damping_ratio, highest, expansion.small_damping)
    gain, own, force = map(_by_line, (*zeroth, p.static_forcing(highest)))
    c = _by_line(np.append(0, p.stiffness_harmonics))
    steps = {j: x for j, x in c.items() if x} | ({0: 0j} if zeroth.damping.any() else {})
    widest = max(map(abs, steps), default=0)
    # the best paths to every line after every step: the rest of a path has the same factor
    kept = {n: [Path((n,), (), (gain[n],), f * gain[n])] for n, f in force.items() if f != 0}
    reaches = (widest * (order - k) for k in range(1, order + 1))
    near = [range(max(-highest, line - r), min(highest, line + r) + 1) for r in reaches]
    came = {n: [n - j for j in steps if j or own[n]] for n in range(-highest, highest + 1)}
    # how many lead to each line after every step, before any is made
    ways = dict.fromkeys(kept, 1)
    for lines in near if most is None else ():
        ways = {n: sum(ways.get(m, 0) for m in came[n]) for n in lines}
        if max(ways.values()) > MOST_PATHS:
            raise ArgumentError(
                f"line {line} has more than {MOST_PATHS} terms at order {order}: ask for the "
                "largest with most=20"
            )
    for lines in near:
        found: dict[int, list[Path]] = {}
        for n in lines:
            longer = [
                path.extended(n, n - m, (steps[n - m] if n - m else own[n]) * gain[n], gain[n])
                for m in came[n]
                for path in kept.get(m, ())
            ]
            if longer:
                found[n] = longer if most is None else heapq.nsmallest(most, longer, key=_order)
        kept = found
    return sorted(kept.get(line, []), key=_order)[:most]


def _by_line(half: Complex) -> dict[int, complex]:
    """Entries of lines -N..N, those below zero conjugate."""
    up = {n: complex(x) for n, x in enumerate(half)}
    return {-n: x.conjugate() for n, x in up.items()} | up


def _order(path: Path) -> tuple[float, tuple[int, ...]]:
    """Largest first; equal ones by their steps, so that the order is always the same."""
    return -abs(path.contribution), path.steps
