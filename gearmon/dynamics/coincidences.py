"""Which harmonics resonate, directly or through products of two.

A stiffness harmonic n with n w = w0 drives the natural vibration through b, one with n w = 2 w0
feeds it through beta (see `resonance`). Where none does, products may: with odd harmonics only and
w0 = 16 w, b starts with c_1 c_15, c_3 c_13, ... at order two. The product of c_j and c_l over a
state in between has the size

    c_j c_l/[(s+ - s-) D(own + i line/R)],    D(s) = s^2 + 2 zeta s + 1

in s = w0 t, summed over both free vibrations in between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics.amplitude_equations import AmplitudeEquations, coupling_of
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.resonance import (
    forced_resonance,
    natural_line,
    nearest_lines,
    parametric_resonance,
)
from gearmon.errors import check_range

NEGLIGIBLE = 1e-14


def coincidences(problem: HillProblem, order: int = 2) -> list[dict[str, float | int | str]]:
    """Which lines resonate, and at which order, among those nearest to the natural frequency.

    Parameters
    ----------
    problem : HillProblem
        What to look at; zeta < 1.
    order : int
        Highest order looked at, >= 1.

    Returns
    -------
    list of dict
        For the forced line n nearest to w0 and the parametric one nearest to 2 w0: kind, harmonic
        n, coupled (whether any order up to `order` couples), order (the first that does; 0 is a
        direct force), detuning_per_s (shifted natural frequency less that of the line),
        coupling_per_s (|b|/(F/k0) or |beta| of that order), damping_per_s (h). A parametric
        resonance is unstable where coupling exceeds hypot(damping, detuning); the steady line of a
        forced one is 2 coupling/hypot(damping, detuning) times F/k0.

    Raises
    ------
    ArgumentError
        If the system is overdamped or the order out of range.
    """
    check_range("order", order, 1, 60)
    still = float(np.abs(problem.static_forcing(len(problem.force_harmonics_n))).max()) or 1.0
    natural = natural_line(problem)
    nearest = max(1, round(natural))
    others = [n for n in nearest_lines(natural) if n != nearest]
    forced = forced_resonance(problem, 0, [nearest, *others], rate_order=order)
    parametric = parametric_resonance(problem, 0, rate_order=order)
    return [
        _row("forced", forced, 1.0, np.abs(forced.forcing_terms[:, 0]) / still),
        _row("parametric", parametric, 2.0, np.abs(parametric.rate_terms[:, 0, 1])),
    ]


def _row(
    kind: str, equations: AmplitudeEquations, multiple: float, sizes: np.ndarray
) -> dict[str, float | int | str]:
    problem = equations.problem
    w0 = 2 * math.pi * problem.natural_frequency_hz
    coupled = np.flatnonzero(sizes > NEGLIGIBLE * w0)
    return {
        "kind": kind,
        "harmonic": round(multiple * equations.slow[0][1]),
        "coupled": len(coupled) > 0,
        "order": int(coupled[0]) if len(coupled) else 0,
        "detuning_per_s": float(equations.rate[0, 0].imag),
        "coupling_per_s": float(sizes[coupled[0]]) if len(coupled) else 0.0,
        "damping_per_s": problem.damping_ns_per_m / (2 * problem.mass_kg),
    }


def products(equations: AmplitudeEquations) -> list[dict[str, float | str]]:
    """Which two stiffness harmonics make the second-order terms of alpha, beta and b.

    Parameters
    ----------
    equations : AmplitudeEquations
        Of one pair of slow states, of any order.

    Returns
    -------
    list of dict
        Largest first within each coefficient: coefficient ("alpha", "beta" or "b"), harmonics
        (first and second step, such as "c_1 c_15"; "damping" for a step of small damping),
        from_line, over_line (the line in between), real and imaginary [1/s; m/s for b]. They sum
        to order 2 of the coefficient; for b, if no force acts on the slow line itself.

    Raises
    ------
    ArgumentError
        If the equations are not those of one pair.
    """
    equations.check_conjugate_pair()
    paths = _TwoSteps(equations)
    found: list[dict[str, float | str]] = [
        {
            "coefficient": start.coefficient,
            "harmonics": f"{_factor(first)} {_factor(second)}",
            "from_line": float(start.line),
            "over_line": float(start.line + first),
            "real": value.real,
            "imaginary": value.imag,
        }
        for start in paths.starts()
        for first, second, value in paths.values(start)
    ]
    names = ["alpha", "beta", "b"]
    found.sort(key=lambda row: (names.index(str(row["coefficient"])), -_size(row)))
    return found


def _size(row: dict[str, float | str]) -> float:
    return math.hypot(float(row["real"]), float(row["imaginary"]))


def _factor(step: int) -> str:
    if step == 0:
        return "damping"
    return f"c_{step}" if step > 0 else f"conj c_{-step}"


@dataclass(frozen=True, kw_only=True)
class _Start:
    """Where two steps begin: amplitudes of both free vibrations on a line, and their exponent."""

    coefficient: str
    line: float
    amplitudes: dict[int, complex]
    own: complex


class _TwoSteps:
    """Second-order paths to the first slow state."""

    def __init__(self, equations: AmplitudeEquations) -> None:
        self.equations = equations
        self.coupling = coupling_of(equations.problem, equations.small_damping)
        self.roots = {1: self.coupling.roots[0], -1: self.coupling.roots[1]}
        self.split = self.roots[1] - self.roots[-1]

    @cached_property
    def steps(self) -> dict[int, complex]:
        """Stiffness harmonics of either sign; 0 stands for small damping."""
        found = {0: 0j} if self.equations.small_damping and self.coupling.zeta else {}
        for j, c in enumerate(self.coupling.harmonics, start=1):
            if c != 0:
                found[j], found[-j] = complex(c), complex(c).conjugate()
        return found

    def starts(self) -> Iterator[_Start]:
        """Both slow states and every line with a force."""
        for name, (sign, line) in zip(("alpha", "beta"), self.equations.slow, strict=True):
            own = self._exponent(sign, line)
            yield _Start(coefficient=name, line=line, amplitudes={sign: 1.0}, own=own)
        problem = self.equations.problem
        half = problem.static_forcing(len(problem.force_harmonics_n))
        for n in np.flatnonzero(half):
            for line, force in {float(n): half[n], -float(n): half[n].conjugate()}.items():
                amplitudes = {
                    sign: -sign * complex(force) / self.split / self._exponent(sign, line)
                    for sign in (1, -1)
                    if (sign, line) not in self.equations.slow
                }
                yield _Start(coefficient="b", line=line, amplitudes=amplitudes, own=0j)

    def values(self, start: _Start) -> Iterator[tuple[int, int, complex]]:
        """Yield (first step, second step, value [1/s or m/s])."""
        distance = self.equations.slow[0][1] - start.line
        if not float(distance).is_integer():
            return
        w0 = 2 * math.pi * self.equations.problem.natural_frequency_hz
        for first in self.steps:
            second = round(distance) - first
            if second in self.steps:
                line = start.line + first
                value = sum(
                    self._weight(first, sign, between)
                    * amplitude
                    * self._weight(second, between, 1)
                    / (start.own - self._exponent(between, line))
                    for sign, amplitude in start.amplitudes.items()
                    for between in (1, -1)
                    if (between, line) not in self.equations.slow
                )
                yield first, second, w0 * complex(value)

    def _exponent(self, sign: int, line: float) -> complex:
        return self.roots[sign] - 1j * line / self.coupling.ratio

    def _weight(self, step: int, before: int, after: int) -> complex:
        size = 2 * self.coupling.zeta * self.roots[before] if step == 0 else self.steps[step]
        return -after * size / self.split
