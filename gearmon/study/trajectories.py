"""Vibration from rest, by direct integration of the equation of motion."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.gears.pulses import ComplexArray, FloatArray
from gearmon.study.reference_case import MeshParameters

Modulation = Callable[[FloatArray], FloatArray]

# A phase this close to a jump is taken from the side of the piece that is being integrated.
_INSIDE = 1e-12
# Enough for a parabola, exactly, and for half a sine arch to rounding.
_DEGREE = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Motion along the line of action at given times.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    displacement_m, velocity_ms, acceleration_ms2 : ndarray, shape (n,)
    mesh_force_n : ndarray, shape (n,)
        k(t) z + c z'.
    """

    time_s: FloatArray
    displacement_m: FloatArray
    velocity_ms: FloatArray
    acceleration_ms2: FloatArray
    mesh_force_n: FloatArray


def series(harmonics: ComplexArray) -> Modulation:
    """Return the function of the phase with the Fourier coefficients c_1..c_J."""
    kept = np.flatnonzero(harmonics)
    rates, weights = 2j * np.pi * (kept + 1), 2 * harmonics[kept]

    def modulation(phase: FloatArray) -> FloatArray:
        turned = np.exp(np.multiply.outer(phase, rates))
        return np.asarray((turned @ weights).real)

    return modulation


def motion(
    parameters: MeshParameters,
    modulation: Modulation,
    time_s: FloatArray,
    displacement_m: FloatArray,
    velocity_ms: FloatArray,
) -> Trajectory:
    """Complete displacement and velocity by what the equation of motion says of the rest."""
    phi = modulation(np.mod(time_s / parameters.period_s, 1.0))
    stiffness = parameters.stiffness_n_per_m * (1 + phi)
    force = stiffness * displacement_m + parameters.damping_ns_per_m * velocity_ms
    return Trajectory(
        time_s=time_s,
        displacement_m=displacement_m,
        velocity_ms=velocity_ms,
        acceleration_ms2=(parameters.force_n - force) / parameters.mass_kg,
        mesh_force_n=force,
    )


def simulate(
    parameters: MeshParameters,
    modulation: Modulation,
    time_s: FloatArray,
    jumps: Sequence[float] = (),
    tolerance: float = 1e-9,
) -> Trajectory:
    """Integrate the equation of motion from rest with SciPy's DOP853, restarted at every jump.

    Parameters
    ----------
    parameters : MeshParameters
    modulation : callable
        k/k0 - 1 as a function of the phase [mesh periods].
    time_s : ndarray, shape (n,)
        Rising times >= 0 at which the motion is wanted.
    jumps : sequence of float
        Phases in [0, 1) at which the stiffness jumps.
    tolerance : float
        Relative tolerance of a step; the absolute one is the same share of F/k0.

    Returns
    -------
    Trajectory
    """
    from scipy.integrate import solve_ivp

    period, state = parameters.period_s, np.zeros(2)
    scale = parameters.static_deflection_m
    absolute = tolerance * scale * np.array([1.0, 2 * np.pi / period])
    found = np.zeros((2, len(time_s)))
    for start, stop in _pieces(float(time_s[-1]) / period, jumps):
        inside = (time_s >= start * period) & (time_s < stop * period * (1 - _INSIDE))
        solution = solve_ivp(
            _slope(parameters, modulation, start, stop, bool(jumps)),
            (start * period, stop * period),
            state,
            method="DOP853",
            t_eval=np.append(time_s[inside], stop * period),
            rtol=tolerance,
            atol=absolute,
        )
        found[:, inside] = solution.y[:, :-1]
        state = solution.y[:, -1]
    found[:, time_s >= float(time_s[-1]) * (1 - _INSIDE)] = state[:, None]
    return motion(parameters, modulation, time_s, found[0], found[1])


def _pieces(periods: float, jumps: Sequence[float]) -> list[tuple[float, float]]:
    """Intervals between jumps [mesh periods], or whole periods where there are none."""
    marks = sorted(set(jumps) | {0.0})
    edges = [n + mark for n in range(int(np.ceil(periods))) for mark in marks]
    edges = [edge for edge in edges if edge < periods] + [periods]
    return list(itertools.pairwise(edges))


def _slope(
    parameters: MeshParameters,
    modulation: Modulation,
    start: float,
    stop: float,
    smooth: bool,
) -> Callable[[float, FloatArray], tuple[float, float]]:
    """Right side of the equation over one piece."""
    whole = np.floor(start + _INSIDE)
    low, high = float(start - whole), float(stop - whole - _INSIDE)
    phi = _polynomial(modulation, low, high) if smooth else _scalar(modulation)
    period, mass = parameters.period_s, parameters.mass_kg
    stiffness, damping = parameters.stiffness_n_per_m, parameters.damping_ns_per_m
    force = parameters.force_n

    def slope(time: float, state: FloatArray) -> tuple[float, float]:
        phase = min(max(time / period - whole, low), high)
        restoring = stiffness * (1 + phi(phase)) * state[0]
        return state[1], (force - damping * state[1] - restoring) / mass

    return slope


def _scalar(modulation: Modulation) -> Callable[[float], float]:
    return lambda phase: float(modulation(np.asarray(phase)))


def _polynomial(modulation: Modulation, low: float, high: float) -> Callable[[float], float]:
    """Evaluate a curve that is smooth between two phases by its polynomial there, much faster."""
    fitted = np.polynomial.Chebyshev.interpolate(modulation, _DEGREE, domain=[low, high])
    monomials = fitted.convert(kind=np.polynomial.Polynomial, domain=[low, high])
    coefficients = monomials.coef[::-1].tolist()
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def value(phase: float) -> float:
        x, total = (phase - middle) / half, 0.0
        for coefficient in coefficients:
            total = total * x + coefficient
        return float(total)

    return value
