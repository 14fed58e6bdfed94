"""Where a line comes from: the terms of multiple scales one by one.

Order k of line n is a sum over paths: start at a line s that a force drives, take k steps by
stiffness harmonics j_1, ..., j_k (negative for the conjugate) with s + j_1 + ... + j_k = n, and
gain 1/D at every line on the way:

    Z^(k)_n = (-1)^k sum_paths (f_s/k0)/D_s * c_{j1}/D_{s+j1} * c_{j2}/D_{s+j1+j2} ... c_{jk}/D_n

So line 3 at order 2 is made of c_1 c_2 (over line 1 or line 2), c_4 conj(c_1), and so on. Where
damping is small it takes steps, too: from a line to itself with 2 i zeta n/R in place of c_j.

Source: the recursion of `multiple_scales`, written out.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Complex
from gearmon.dynamics.multiple_scales import Expansion, Zeroth
from gearmon.errors import ArgumentError, check_range

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
    >>> from gearmon.dynamics.multiple_scales import expand
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
    for k in range(1, order + 1):
        reach = widest * (order - k)
        found: dict[int, list[Path]] = {}
        for n in range(max(-highest, line - reach), min(highest, line + reach) + 1):
            longer = [
                path.extended(n, j, (x if j else own[n]) * gain[n], gain[n])
                for j, x in steps.items()
                for path in kept.get(n - j, ())
                if j or own[n]
            ]
            if most is None and len(longer) > MOST_PATHS:
                raise ArgumentError(
                    f"line {line} has more than {MOST_PATHS} terms at order {order}: ask for the "
                    "largest with most=20"
                )
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
