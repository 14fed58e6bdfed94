"""Sidebands of faults on any shafts, superposed, with the neglected cross terms bounded.

The stiffness is phi = phi_0 + sum delta_f: phi_0 repeats with the mesh, delta_f with a turn of P_f
meshes and has no share in the mesh harmonics. With z_0 the vibration under phi_0 and L_0 its
operator, three answers are

first order   L_0 b_f = -delta_f z_0: proportional to every fault, family by family
shafts apart  (L_0 + delta_f) b_f = -delta_f z_0: each shaft exactly, by itself
coupled       all faults at once over their common turn

and z_0 + sum b_f leaves a residual that is computed; -sum_{f != g} delta_f b_g is what superposing
neglects. With a gain that holds over any turn (`sideband_bounds`) its effect on the sidebands is
bounded without ever building the common turn of, say, 26 x 53 meshes. One shaft by itself is solved
by `steady_state`, which costs less than the matrices of its families: those pay for many sizes of
one fault, see `sidebands_of_sizes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.certificate import Certifier
from gearmon.dynamics.error_bound import Gain
from gearmon.dynamics.fourier import Complex, Modulation, Real, rms
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.shaft_faults import ShaftFault, added_up, joined
from gearmon.dynamics.sideband_bounds import (
    TurnGain,
    answered,
    common_lines,
    rms_of_product,
    rounding,
    turn_gain,
)
from gearmon.dynamics.sideband_cross import Part, followed
from gearmon.dynamics.sideband_families import Families, answers, dynamic_stiffness
from gearmon.dynamics.steady_state import steady_state
from gearmon.dynamics.sweep_bounds import swing_of
from gearmon.errors import ArgumentError, check_range

# a common turn this many times the turns by themselves is worth avoiding
SHORT_TURN = 4

Method = Literal["auto", "first order", "shafts apart", "coupled"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sidebands:
    """Vibration of a mesh with faults: mesh lines of the even mesh, and what the faults add.

    Attributes
    ----------
    mesh : HillProblem
        The even mesh, over one mesh period.
    faults : tuple of ShaftFault
        The faults, those on turns of equal length as one.
    carrier : complex ndarray, shape (N+1,)
        z_0, harmonics of the mesh frequency [m].
    added : tuple of (complex ndarray, int)
        What every fault adds [m], as a half spectrum over a turn of so many meshes; one entry for
        all faults if they were coupled.
    error_bound : float
        Guaranteed bound of the rms acceleration of all errors, relative to that of the sidebands
        (all lines but multiples of the mesh frequency).
    cross_bound : float
        The part of it that the neglected cross terms between different shafts make.
    method : str
        "first order", "shafts apart", "families" (many sizes) or "coupled"; see the module.
    message : str
        One line: what was done and why.
    """

    mesh: HillProblem
    faults: tuple[ShaftFault, ...]
    carrier: Complex
    added: tuple[tuple[Complex, int], ...]
    error_bound: float
    cross_bound: float
    method: str
    message: str

    def lines(self) -> tuple[Real, Complex]:
        """Frequencies over the mesh frequency (rising) and displacements [m] of all lines."""
        return common_lines([(self.carrier, 1), *self.added])


def sidebands(
    mesh: HillProblem,
    faults: Sequence[ShaftFault],
    tolerance: float = 1e-2,
    method: Method = "auto",
) -> Sidebands:
    """Sidebands of one or several faults by the cheapest answer that meets a tolerance.

    Parameters
    ----------
    mesh : HillProblem
        The even mesh over one mesh period, with the mean effect of the faults.
    faults : sequence of ShaftFault
        At least one; several on one shaft add up.
    tolerance : float
        Of the error relative to the sidebands, 1e-9 to 1.
    method : str
        "auto", or one of the answers whatever it reaches.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or an answer would not fit in memory.

    Notes
    -----
    The bound is infinite where free vibrations may grow.
    """
    check_range("tolerance", tolerance, 1e-9, 1.0)
    if method not in get_args(Method):
        raise ArgumentError(f"method={method!r} must be one of: {', '.join(get_args(Method))}")
    together = added_up(faults)
    if method == "first order":
        return _Shafts(mesh, together, tolerance).to_first_order(tolerance)
    turn = math.lcm(*(fault.meshes for fault in together))
    long = turn > SHORT_TURN * sum(fault.meshes for fault in together)
    if method == "shafts apart" or (method == "auto" and long):
        found = _Shafts(mesh, together, tolerance).apart(tolerance)
        if found.error_bound <= tolerance or method == "shafts apart":
            return found
    return _coupled(mesh, together, tolerance)


def sidebands_of_sizes(
    mesh: HillProblem,
    fault: ShaftFault,
    factors: npt.ArrayLike,
    tolerance: float = 1e-2,
) -> tuple[Sidebands, ...]:
    """Sidebands of one fault at several sizes, for about the cost of the largest.

    Parameters
    ----------
    mesh : HillProblem
        The even mesh over one mesh period, the same for all sizes.
    fault : ShaftFault
        The fault at size 1.
    factors : float array, shape (S,)
        Sizes, any numbers but 0.
    tolerance : float
        As in `sidebands`.
    """
    check_range("tolerance", tolerance, 1e-9, 1.0)
    sizes = np.atleast_1d(np.asarray(factors, dtype=float))
    if sizes.ndim != 1 or not np.isfinite(sizes).all() or not sizes.all():
        raise ArgumentError(f"factors={factors!r}: must be one row of finite numbers other than 0")
    shafts = _Shafts(mesh, (fault.scaled(float(np.abs(sizes).min())),), tolerance)
    families, delta, carrier = shafts.families(0)
    smallest = float(np.abs(sizes).min())
    found = answers(families, delta, carrier, sizes / smallest, shafts.inner(tolerance))
    return tuple(
        shafts.judged((fault.scaled(size),), [half], "families", tolerance, found.orders)
        for size, half in zip(sizes, found.lines, strict=True)
    )


class _Shafts:
    """The even mesh solved, and the families of every shaft."""

    def __init__(self, mesh: HillProblem, faults: tuple[ShaftFault, ...], tolerance: float) -> None:
        self.mesh, self.faults = mesh, faults
        self.ratio, self.zeta = mesh.frequency_ratio, mesh.damping_ratio
        self.mesh_swing = swing_of(mesh.stiffness_harmonics)
        added = sum(rms(np.append(0, f.stiffness_harmonics)) for f in faults)
        whole = rms(np.append(0, mesh.stiffness_harmonics)) + added + 1e-300
        # errors of the mesh lines count beside the sidebands
        self.tight = min(1e-3, max(1e-12, 0.1 * tolerance * added / whole))
        self.carrier = steady_state(mesh, self.tight).displacement
        self.highest = len(self.carrier) - 1

    def inner(self, tolerance: float) -> float:
        """Relative residual of an answer that leaves a share of the tolerance."""
        return 0.1 * tolerance * min(1.0, 2 * self.zeta)

    def families(self, number: int) -> tuple[Families, Complex, Complex]:
        """Inverse for a shaft, harmonics of its fault, and the carrier on the lines of its turn."""
        fault = self.faults[number]
        carrier = np.zeros(self.highest * fault.meshes + 1, dtype=complex)
        carrier[:: fault.meshes] = self.carrier
        even = self.mesh.stiffness_harmonics
        families = Families(self.ratio * fault.meshes, self.zeta, even, fault.meshes, self.highest)
        return families, fault.stiffness_harmonics, carrier

    def to_first_order(self, tolerance: float) -> Sidebands:
        """All faults to first order; their error is the distance from each shaft exactly."""
        halves = []
        for number in range(len(self.faults)):
            families, delta, carrier = self.families(number)
            forcing = -_product(delta, carrier, families.top)
            halves.append(families.solve(forcing))
        exact = [half for half, _ in self.apart(tolerance).added]
        return self.judged(self.faults, halves, "first order", tolerance, 1, exact)

    def apart(self, tolerance: float) -> Sidebands:
        """Each shaft exactly, by itself."""
        halves, orders = [], 0
        for fault in self.faults:
            response = steady_state(joined(self.mesh, (fault,)), self.tight)
            half = np.zeros(
                max(len(response.displacement), self.highest * fault.meshes + 1), dtype=complex
            )
            half[: len(response.displacement)] = response.displacement
            half[: self.highest * fault.meshes + 1 : fault.meshes] -= self.carrier
            halves.append(half)
            orders = max(orders, response.order)
        return self.judged(self.faults, halves, "shafts apart", tolerance, orders)

    def judged(
        self,
        faults: tuple[ShaftFault, ...],
        halves: list[Complex],
        method: str,
        tolerance: float,
        orders: int,
        exact: list[Complex] | None = None,
    ) -> Sidebands:
        """Answers with the bound of what they, or better ones, leave undone."""
        better = halves if exact is None else exact
        if len(faults) == 1:
            gain = None
            error = self._alone_error(faults[0], better[0], tolerance)
        else:
            gain = turn_gain(
                self.ratio, self.zeta, self.mesh_swing, [(f.swing, f.meshes) for f in faults]
            )
            error = self._carrier_error(gain)
            error += sum(
                self._own_error(f, half, gain) for f, half in zip(faults, better, strict=True)
            )
        if exact is not None:
            for fault, half, other in zip(faults, halves, exact, strict=True):
                error += _distance(half, other, self.ratio * fault.meshes)
        crossed = sum(
            rms_of_product(np.append(0, f.stiffness_harmonics), f.meshes, half, other.meshes)
            for f in faults
            for other, half in zip(faults, better, strict=True)
            if f is not other
        )
        parts = tuple((half, f.meshes) for f, half in zip(faults, halves, strict=True))
        size = _sideband_size(parts, self.ratio)
        cross = gain.acceleration * crossed if gain and crossed else 0.0
        if gain and cross > 0.5 * tolerance * size and gain.acceleration < math.inf:
            cross = min(cross, self._followed(faults, better, gain))
        total = error + cross
        bound, cross_bound = (
            part / (size - total) if total < size else math.inf for part in (total, cross)
        )
        verdict = "meets" if bound <= tolerance else "misses"
        how = "to first order" if method == "first order" else f"each exactly, {orders} orders"
        what = "1 shaft" if len(faults) == 1 else f"{len(faults)} shafts"
        return Sidebands(
            mesh=self.mesh,
            faults=faults,
            carrier=self.carrier,
            added=parts,
            error_bound=bound,
            cross_bound=cross_bound,
            method=method,
            message=f"{what} {how}: error bound {bound:.2g} of the sidebands ({cross_bound:.2g} "
            f"from cross terms) {verdict} the tolerance {tolerance:.2g}",
        )

    def _alone_error(self, fault: ShaftFault, half: Complex, tolerance: float) -> float:
        """Error of one fault and the carrier, over their turn; by the gain that is good enough."""
        turn = joined(self.mesh, (fault,))
        z = half.copy()
        z[: self.highest * fault.meshes + 1 : fault.meshes] += self.carrier
        dynamic = z - turn.static_forcing(len(z) - 1) / turn.dynamic_stiffness(len(z) - 1)
        gain = turn_gain(self.ratio, self.zeta, self.mesh_swing, [(fault.swing, fault.meshes)])
        allowed = tolerance * _sideband_size([(half, fault.meshes)], self.ratio)
        if gain.acceleration < math.inf:
            certifier = Certifier(turn)
            # a known gain spares that of the whole turn
            certifier.gain = Gain(acceleration=gain.acceleration, source="any turn", stable=True)
            error = certifier.judge(dynamic).bound.total
            if error <= 0.5 * allowed:
                return error
        certifier = Certifier(turn)
        return certifier.judge(dynamic).bound.total if certifier.gain.stable else math.inf

    def _followed(
        self, faults: tuple[ShaftFault, ...], halves: list[Complex], gain: TurnGain
    ) -> float:
        """Bound of the cross terms over the common turn."""
        parts = [
            Part(meshes=f.meshes, delta=np.append(0, f.stiffness_harmonics), added=half)
            for f, half in zip(faults, halves, strict=True)
        ]
        even = np.append(0, self.mesh.stiffness_harmonics)
        return followed(self.ratio, self.zeta, even, parts, gain)

    def _carrier_error(self, gain: TurnGain) -> float:
        """Error that the residual of the mesh lines makes."""
        count = len(self.mesh.stiffness_harmonics)
        reach = self.highest + count
        stiffness = dynamic_stiffness(self.ratio, self.zeta, np.arange(reach + 1))
        residual = self.mesh.static_forcing(reach)
        residual -= _product(self.mesh.stiffness_harmonics, self.carrier, reach)
        residual[: self.highest + 1] -= stiffness[: self.highest + 1] * self.carrier
        weights = (np.arange(reach + 1) / self.ratio) ** 2
        noise = rounding(self.carrier, stiffness[: self.highest + 1], 1 + gain.swing)
        left = answered(residual, stiffness, weights, self.highest, gain)
        return left + gain.acceleration * noise

    def _own_error(self, fault: ShaftFault, half: Complex, gain: TurnGain) -> float:
        """Error that the residual of one fault alone makes."""
        meshes, top = fault.meshes, len(half) - 1
        even = np.zeros(len(self.mesh.stiffness_harmonics) * meshes, dtype=complex)
        even[meshes - 1 :: meshes] = self.mesh.stiffness_harmonics
        whole = np.zeros(max(len(even), len(fault.stiffness_harmonics)), dtype=complex)
        whole[: len(even)] = even
        whole[: len(fault.stiffness_harmonics)] += fault.stiffness_harmonics
        reach = top + len(whole)
        carrier = np.zeros(self.highest * meshes + 1, dtype=complex)
        carrier[::meshes] = self.carrier
        stiffness = dynamic_stiffness(self.ratio * meshes, self.zeta, np.arange(reach + 1))
        residual = -_product(whole, half, reach)
        residual -= _product(fault.stiffness_harmonics, carrier, reach)
        residual[: top + 1] -= stiffness[: top + 1] * half
        weights = (np.arange(reach + 1) / (self.ratio * meshes)) ** 2
        noise = rounding(half, stiffness[: top + 1], gain.swing)
        noise += rounding(self.carrier, np.zeros_like(self.carrier), fault.swing.highest)
        left = answered(residual, stiffness, weights, top, gain)
        return left + gain.acceleration * noise


def _product(harmonics: Complex, half: Complex, reach: int) -> Complex:
    """Harmonics 0..reach of phi y."""
    inputs = len(half) - 1
    product: Complex = np.zeros(reach + 1, dtype=complex)
    outputs = min(reach, inputs + len(harmonics))
    product[: outputs + 1] = Modulation(harmonics, inputs, outputs)(half)
    return product


def _distance(first: Complex, second: Complex, ratio: float) -> float:
    """Rms acceleration over w0^2 of the difference of two half spectra."""
    apart = np.zeros(max(len(first), len(second)), dtype=complex)
    apart[: len(first)] = first
    apart[: len(second)] -= second
    return rms((np.arange(len(apart)) / ratio) ** 2 * apart)


def _sideband_size(parts: Sequence[tuple[Complex, int]], ratio: float) -> float:
    """Rms acceleration over w0^2 of all lines that are no mesh lines; R of the mesh."""
    orders, lines = common_lines(parts)
    aside = np.abs(orders - np.round(orders)) > 1e-9
    return math.sqrt(2 * float((np.abs(lines[aside]) ** 2 * (orders[aside] / ratio) ** 4).sum()))


def _coupled(mesh: HillProblem, faults: tuple[ShaftFault, ...], tolerance: float) -> Sidebands:
    """All faults over their common turn."""
    turn = math.lcm(*(f.meshes for f in faults))
    problem, aim = joined(mesh, faults), 0.1 * tolerance
    carrier = steady_state(mesh, 1e-9).displacement
    for _ in range(2):
        response = steady_state(problem, max(1e-13, aim))
        half = response.displacement.copy()
        count = min(len(half), (len(carrier) - 1) * turn + 1)
        half[:count:turn] -= carrier[: (count - 1) // turn + 1]
        size = _sideband_size([(half, turn)], mesh.frequency_ratio)
        weights = (np.arange(len(half)) / problem.frequency_ratio) ** 2
        whole = rms(weights * response.displacement)
        # the bound is relative to the true acceleration, at most 1/(1 - bound) times this one
        bound = response.error_bound
        error = bound / (1 - bound) * whole if bound < 1 else math.inf
        relative = error / (size - error) if error < size else math.inf
        if relative <= tolerance or size == 0:
            break
        aim = min(0.1 * aim, 0.5 * tolerance * size / whole)
    return Sidebands(
        mesh=mesh,
        faults=faults,
        carrier=carrier,
        added=((half, turn),),
        error_bound=relative,
        cross_bound=0.0,
        method="coupled",
        message=f"all faults over {turn} meshes: error bound {relative:.2g} of the sidebands; "
        + response.message,
    )
