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
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.multiple_scales import Expansion, zeroth_stiffness
from gearmon.errors import ArgumentError, check_range

MOST_PATHS = 200_000


@dataclass(frozen=True, kw_only=True)
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
        factors = ["(F/k0)" if start == 0 else f"({_force(start)}/k0/D_{start})"]
        factors += [f"({_step(j)}/D_{n})" for j, n in zip(self.steps, self.lines[1:], strict=True)]
        return sign + " ".join(factors)


def _force(line: int) -> str:
    return f"f_{line}" if line > 0 else f"conj f_{-line}"


def _step(j: int) -> str:
    if j == 0:
        return "2i zeta n/R"
    return f"c_{j}" if j > 0 else f"conj c_{-j}"


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
        than 200,000.

    Examples
    --------
    >>> from gearmon.dynamics.multiple_scales import expand
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065, 0.02], 1.6e-3, 4e3)
    >>> for path in paths(expand(p, 2), 3, 2):
    ...     print(path.text)
    (F/k0) (c_2/D_2) (c_1/D_3)
    (F/k0) (c_1/D_1) (c_2/D_3)
    """
    check_range("order", order, 0, expansion.order)
    check_range("line", line, 0, expansion.terms.shape[1] - 1)
    network = _Network(expansion)
    if most is None:
        count = network.count(line, order)
        if count > MOST_PATHS:
            raise ArgumentError(
                f"line {line} has {count} terms at order {order}, more than {MOST_PATHS}: ask for "
                "the largest with most=20"
            )
    else:
        check_range("most", most, 1, MOST_PATHS)
    return network.largest(line, order, most)


def rows(
    expansion: Expansion, line: int, order: int, most: int | None = 12
) -> list[dict[str, float | str]]:
    """Terms of one order of one line as a table.

    Parameters
    ----------
    expansion, line, order, most
        As in `paths`.

    Returns
    -------
    list of dict
        term (formula), path ("0 > 1 > 3"), amplitude_m (2|.|, or |.| for line 0), phase_rad, share
        (part of the line's order, in phase with it; all shares of an order sum to 1, unless that
        order vanishes: then 0), weakest_stiffness (smallest |D| on the way: how near a resonance).
    """
    whole = complex(expansion.terms[order, line])
    twice = 2 if line else 1
    return [
        {
            "term": path.text,
            "path": " > ".join(str(n) for n in path.lines),
            "amplitude_m": twice * abs(path.contribution),
            "phase_rad": float(np.angle(path.contribution)),
            "share": (path.contribution / whole).real if whole != 0 else 0.0,
            "weakest_stiffness": 1 / max(abs(gain) for gain in path.gains),
        }
        for path in paths(expansion, line, order, most)
    ]


_Partial = tuple[float, complex, tuple[int, ...], tuple[int, ...]]


class _Network:
    """Lines, and the steps between them with their weights."""

    def __init__(self, expansion: Expansion) -> None:
        self.expansion = expansion
        self.highest = expansion.terms.shape[1] - 1

    @property
    def problem(self) -> HillProblem:
        return self.expansion.problem

    @cached_property
    def _diagonal(self) -> tuple[list[complex], list[float]]:
        stiffness, damping = zeroth_stiffness(
            self.problem, self.highest, self.expansion.small_damping
        )
        return [complex(d) for d in 1 / stiffness], [float(d) for d in damping]

    def gain(self, line: int) -> complex:
        """1/D of a line of either sign."""
        value = self._diagonal[0][abs(line)]
        return value if line >= 0 else value.conjugate()

    @cached_property
    def sources(self) -> dict[int, complex]:
        """Lines that forces drive, and their Z^(0)."""
        forcing = self.problem.static_forcing(self.highest)
        found = {0: complex(forcing[0]) * self.gain(0)}
        for n in np.flatnonzero(forcing[1:]) + 1:
            found[int(n)] = complex(forcing[n]) * self.gain(int(n))
            found[-int(n)] = found[int(n)].conjugate()
        return {n: value for n, value in found.items() if value != 0}

    @cached_property
    def steps(self) -> dict[int, complex]:
        """Stiffness harmonics of either sign that are not zero."""
        found = {}
        for j, c in enumerate(self.problem.stiffness_harmonics, start=1):
            if c != 0:
                found[j], found[-j] = complex(c), complex(c).conjugate()
        return found

    def steps_into(self, line: int) -> Iterator[tuple[int, int, complex]]:
        """Each (step, line before, factor) that leads to a line."""
        gain = self.gain(line)
        for j, c in self.steps.items():
            if abs(line - j) <= self.highest:
                yield j, line - j, -c * gain
        damping = self._diagonal[1][abs(line)]
        if damping:
            yield 0, line, -1j * math.copysign(damping, line) * gain

    def _reachable(self, line: int, left: int) -> range:
        """Lines from which `line` can still be reached in `left` steps."""
        widest = max((abs(j) for j in self.steps), default=0) * left
        return range(max(-self.highest, line - widest), min(self.highest, line + widest) + 1)

    def count(self, line: int, order: int) -> int:
        """Count the paths without listing them."""
        numbers = dict.fromkeys(self.sources, 1)
        for k in range(1, order + 1):
            numbers = {
                n: found
                for n in self._reachable(line, order - k)
                if (found := sum(numbers.get(m, 0) for _, m, _ in self.steps_into(n)))
            }
        return numbers.get(line, 0)

    def largest(self, line: int, order: int, most: int | None) -> list[Path]:
        """Best paths to every line after every step: the rest of a path has the same factor."""
        kept: dict[int, list[_Partial]] = {
            n: [(abs(value), value, (n,), ())] for n, value in self.sources.items()
        }
        for k in range(1, order + 1):
            kept = {
                n: found
                for n in self._reachable(line, order - k)
                if (found := self._best(self._extended(kept, n), most))
            }
        return [self._path(partial) for partial in self._best(iter(kept.get(line, [])), most)]

    def _extended(self, kept: dict[int, list[_Partial]], line: int) -> Iterator[_Partial]:
        for j, before, factor in self.steps_into(line):
            for _, value, lines, steps in kept.get(before, ()):
                made = value * factor
                yield abs(made), made, (*lines, line), (*steps, j)

    @staticmethod
    def _best(partials: Iterator[_Partial], most: int | None) -> list[_Partial]:
        if most is None:
            return sorted(partials, key=_order)
        return heapq.nsmallest(most, partials, key=_order)

    def _path(self, partial: _Partial) -> Path:
        _, value, lines, steps = partial
        return Path(
            lines=lines,
            steps=steps,
            gains=tuple(self.gain(n) for n in lines),
            contribution=value,
        )


def _order(partial: _Partial) -> tuple[float, tuple[int, ...]]:
    """Largest first; equal ones by their steps, so that the order is always the same."""
    return -partial[0], partial[3]
