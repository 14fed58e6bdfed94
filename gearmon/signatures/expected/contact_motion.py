"""Motion of one mass on a varying spring: over a period, and with a few mesh periods of it changed.

In mesh phase s = t/T the equation ``m z'' + c (z - e)' + k (z - e) = F`` reads, with
gamma = c T/m, kappa = k T^2/m and phi = F T^2/m,

    z' = u + gamma e,    u' = -gamma u - kappa z + phi + (kappa - gamma^2) e

in which e may jump. Between the corners of k and e the motion is smooth, and a polynomial through
16 Gauss points of each panel follows it to nearly all digits (Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, section II.7).

With a damaged tooth the stiffness is that of the healthy mesh but for the one to three mesh periods
in which the tooth is in contact. Only these are solved anew; through the rest of the turn what the
tooth has set off dies away as free vibration of the healthy mesh, ``y_{p+1} = M y_p``, so that its
sum over all mesh periods of the turn is a geometric series of 2 x 2 matrices. Every size of damage
is exact, without an expansion in it, and costs the contact of one tooth whatever the gear.

Lines are those of the speed z', which has no jumps that displacement excitation could make
infinite: ``z_r = speed_r / (2 pi i r/P)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.gears.pulses import PanelCurves, gauss, panel_nodes

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

#: Collocation points of a panel, and the largest turn [rad] of the fastest part over half of it:
#: together they integrate that part to about 1e-12.
POINTS, LARGEST_HALF_TURN = 16, 9.0
#: Collocation points transformed together; bounds the memory.
POINTS_PER_BLOCK = 8192
#: Share of the change at which a response per unit of it is taken, by central differences: they
#: leave out some 1e-8 of it and lose as much to rounding.
SMALL_SHARE = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseGrid:
    """Panels of a mesh period, or of a whole turn, and the collocation points on them.

    Parameters
    ----------
    edges : ndarray of float, shape (panels + 1,)
        From 0 to the period, increasing.
    """

    edges: FloatArray

    @classmethod
    def between(cls, corners: FloatArray, fastest: float, period: int = 1) -> PhaseGrid:
        """Return panels between corners, fine enough for `fastest` cycles a mesh period."""
        folded = np.unique(np.concatenate([np.mod(corners, period), [0.0, period]]))
        folded = folded[np.concatenate([[True], np.diff(folded) > 1e-11])]
        folded[-1] = period
        longest = LARGEST_HALF_TURN / (math.pi * max(fastest, 1.0))
        parts = [
            np.linspace(low, high, max(1, math.ceil((high - low) / longest)) + 1)[:-1]
            for low, high in pairwise(folded.tolist())
        ]
        return cls(edges=np.concatenate([*parts, [float(period)]]))

    def halved(self) -> PhaseGrid:
        """Return every panel cut in two."""
        middles = 0.5 * (self.edges[1:] + self.edges[:-1])
        return PhaseGrid(edges=np.sort(np.concatenate([self.edges, middles])))

    @cached_property
    def widths(self) -> FloatArray:
        """Lengths of the panels."""
        return np.diff(self.edges)

    @cached_property
    def phase(self) -> FloatArray:
        """Collocation points, shape (panels, points)."""
        return panel_nodes(self.edges, POINTS)

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of integrals over the mesh period, shape (panels, points)."""
        return np.asarray(self.widths[:, None] * (0.5 * gauss(POINTS)[1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicMotion:
    """The motion of which all periods of a grid are alike.

    Parameters
    ----------
    grid : PhaseGrid
    gamma, phi : float
        c T/m, F T^2/m [m].
    kappa : ndarray, shape (panels, points)
        k T^2/m.
    excitation : ndarray, same shape, optional
        e [m].

    Raises
    ------
    ArgumentError
        If free vibrations do not die out.
    """

    grid: PhaseGrid
    gamma: float
    phi: float
    kappa: FloatArray
    excitation: FloatArray | None = None

    def __post_init__(self) -> None:
        growth = float(np.abs(np.linalg.eigvals(self.monodromy)).max())
        if not growth < 1 - 1e-9:
            raise ArgumentError(
                f"free vibrations do not die out, they grow {growth:.9g} times a period: there is "
                f"no steady state; raise damping_ratio or change speed_rpm"
            )

    def forced(self, kappa: FloatArray, excitation: FloatArray | None) -> _PanelMaps:
        """Return the motion on the panels of mesh periods with other stiffness or excitation."""
        push = np.full(kappa.shape, self.phi)
        shift = None
        if excitation is not None:
            push += (kappa - self.gamma**2) * excitation
            shift = self.gamma * excitation
        periods = kappa.shape[-2] // len(self.grid.widths)
        return _panel_maps(np.tile(self.grid.widths, periods), self.gamma, kappa, push, shift)

    @cached_property
    def maps(self) -> _PanelMaps:
        """Motion on the panels."""
        return self.forced(self.kappa, self.excitation)

    @cached_property
    def monodromy(self) -> FloatArray:
        """M, free vibration over a period of the grid, shape (2, 2)."""
        return np.asarray(self.maps.whole[:, :2])

    @cached_property
    def start(self) -> FloatArray:
        """State (z, u) [m] when the period begins."""
        return np.asarray(np.linalg.solve(np.eye(2) - self.monodromy, self.maps.whole[:, 2]))

    @cached_property
    def motion(self) -> tuple[FloatArray, FloatArray]:
        """Motion z and speed z' [m] at the collocation points, shape (panels, points)."""
        z, u = self.maps.at(self.maps.states(self.start))
        return z, u if self.excitation is None else u + self.gamma * self.excitation

    @property
    def least_force(self) -> float:
        """Least mesh force over its mean; at or below 0 teeth part."""
        z, speed = self.motion
        moved = 0.0 if self.excitation is None else self.excitation
        return float((self.kappa * (z - moved) + self.gamma * speed).min() / self.phi)

    @property
    def unresolved(self) -> float:
        """Share of z' in the last two Legendre terms of the panels; see `Deviations`."""
        return float(_unresolved(self.motion[1][None], self.grid.widths)[0])

    def lines(self, highest: int, period: int = 1) -> ComplexArray:
        """Return the harmonics 1..highest of the period of z [m], with P mesh periods in it."""
        phase, weights = self.grid.phase.ravel(), self.grid.weights.ravel()
        speed = weights * self.motion[1].ravel()
        meshes = highest // period + 1
        table = np.zeros((meshes, period), dtype=np.complex128)
        for low in range(0, len(phase), POINTS_PER_BLOCK):
            block = slice(low, low + POINTS_PER_BLOCK)
            turned = np.exp(-2j * np.pi * phase[block])
            slowly = np.exp(-2j * np.pi / period * phase[block])
            fast = _powers(turned, speed[block].astype(np.complex128), meshes)
            table += fast @ _powers(slowly, np.ones_like(slowly), period).T
        found = table.ravel()[1 : highest + 1]
        return np.asarray(found / (2j * np.pi * np.arange(1, highest + 1)))

    @cached_property
    def free(self) -> FloatArray:
        """Speed z' at the points per unit of z and u at the start, shape (panels * points, 2)."""
        z, u, step = (part.copy() for part in (self.maps.z, self.maps.u, self.maps.step))
        for part in (z, u, step):
            part[..., 2] = 0.0
        bare = _PanelMaps(z=z, u=u, step=step)
        return np.stack([bare.at(bare.states(unit))[1].ravel() for unit in np.eye(2)], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """How turns with a few changed mesh periods differ from an even mesh.

    Parameters
    ----------
    mesh : PeriodicMotion
        Of one mesh period.
    period : int
        P, mesh periods of a turn.
    speed : ndarray of float, shape (turns, W panels, points)
        Change of z' [m] in the mesh periods 0..W-1 that differ.
    after : ndarray of float, shape (turns, 2)
        Deviation of the state when they end.
    least_force : ndarray of float, shape (turns,)
        Least mesh force over its mean, up to one mesh period after; at or below 0 teeth part.
    """

    mesh: PeriodicMotion
    period: int
    speed: FloatArray
    after: FloatArray
    least_force: FloatArray

    @property
    def _window(self) -> int:
        return int(self.speed.shape[1] // len(self.mesh.grid.widths))

    @property
    def unresolved(self) -> FloatArray:
        """Share of the change of z' in the last two Legendre terms of the panels, (turns,).

        An estimate of the relative error: where the panels suffice the terms fall fast, and what
        is left out is less than what is still seen.
        """
        return _unresolved(self.speed, np.tile(self.mesh.grid.widths, self._window))

    def lines(self, highest: int) -> ComplexArray:
        """Return the harmonics 1..highest of the turn of the change of z [m], (turns, highest)."""
        period, window = self.period, self._window
        speed = self.speed.reshape(len(self.after), window, -1)
        phase, weights = self.mesh.grid.phase.ravel(), self.mesh.grid.weights.ravel()
        meshes = np.arange(highest // period + 1)
        turned = np.exp(-2j * np.pi * np.outer(meshes, phase)) * weights
        found = np.zeros((len(speed), highest + 1), dtype=np.complex128)
        for r in range(min(period, highest + 1)):
            slow = np.exp(-2j * np.pi * r / period * np.arange(window))
            sums = np.tensordot(speed, slow, axes=(1, 0)) + (self._rest(r) @ self.mesh.free.T)
            sums *= np.exp(-2j * np.pi * r / period * phase)
            count = (highest - r) // period + 1
            found[:, r::period] = sums @ turned[:count].T
        return np.asarray(found[:, 1:] / (2j * np.pi * np.arange(1, highest + 1)))

    def _rest(self, r: int) -> ComplexArray:
        """Sum over the mesh periods W..P-1 of state and turning factor, shape (turns, 2)."""
        left = self.period - self._window
        if not left:
            return np.zeros((len(self.after), 2), dtype=np.complex128)
        unit = np.exp(-2j * np.pi * r / self.period)
        free = self.mesh.monodromy
        series = np.linalg.solve(
            np.eye(2) - unit * free,
            np.eye(2) - unit**left * np.linalg.matrix_power(free, left),
        )
        # unit^W is the place of the first of them
        return np.asarray(unit**self._window * (self.after @ series.T))


def deviations(
    mesh: PeriodicMotion, period: int, kappa: FloatArray, excitation: FloatArray | None = None
) -> Deviations:
    """Solve turns in which the first W mesh periods differ.

    Parameters
    ----------
    mesh : PeriodicMotion
        Of one mesh period, without excitation.
    period : int
        P >= W.
    kappa : ndarray, shape (turns, W panels, points)
        k T^2/m in these periods.
    excitation : ndarray, same shape, optional
        e [m] in these periods; zero in the others.
    """
    window = kappa.shape[1] // len(mesh.grid.widths)
    maps = mesh.forced(kappa, excitation)
    # how the deviation from the even motion passes through the changed periods, then the others
    changed = maps.whole.copy()
    between = np.linalg.matrix_power(mesh.monodromy, period - window)
    changed[..., 2] = (maps.whole @ np.append(mesh.start, 1.0)) - mesh.start
    total = between @ changed
    first = np.linalg.solve(np.eye(2) - total[..., :2], total[..., 2:])
    state = np.asarray(first[..., 0], dtype=np.float64)
    z, speed = maps.at(maps.states(mesh.start + state))
    state = _applied(changed, state)
    if excitation is not None:
        z, speed = z - excitation, speed + mesh.gamma * excitation
    force = kappa * z + mesh.gamma * speed
    z, later = mesh.maps.at(mesh.maps.states(mesh.start + state))
    least = [part.min(axis=(1, 2)) for part in (force, mesh.kappa * z + mesh.gamma * later)]
    return Deviations(
        mesh=mesh,
        period=period,
        speed=speed - np.tile(mesh.motion[1], (window, 1)),
        after=state,
        least_force=np.minimum(*least) / mesh.phi,
    )


def lines_per_unit(
    mesh: PeriodicMotion, period: int, kappa: FloatArray, highest: int
) -> ComplexArray:
    """Return the lines that the first part of a change of stiffness makes, per whole change.

    Parameters
    ----------
    mesh, period
        As in `deviations`.
    kappa : ndarray, shape (W panels, points)
        k T^2/m with the whole change.
    highest : int

    Returns
    -------
    ndarray of complex, shape (highest,)
        As `Deviations.lines`.
    """
    even = np.tile(mesh.kappa, (len(kappa) // len(mesh.kappa), 1))
    small = SMALL_SHARE * (kappa - even)
    more, less = deviations(mesh, period, np.stack([even + small, even - small])).lines(highest)
    return np.asarray((more - less) / (2 * SMALL_SHARE))


@dataclass(frozen=True, kw_only=True, eq=False)
class _PanelMaps:
    """Motion on each panel as an affine function of the state (z, u) at its start.

    Parameters
    ----------
    z, u : ndarray of float, shape (..., panels, points, 3)
        At the collocation points, per unit of z and of u at the start, and by the forcing.
    step : ndarray of float, shape (..., panels, 2, 3)
        The state at the end.
    """

    z: FloatArray
    u: FloatArray
    step: FloatArray

    @cached_property
    def _ends(self) -> FloatArray:
        """Maps from the start of the first panel to the end of each, shape (..., panels, 2, 3)."""
        ends, reach = self.step, 1
        while reach < ends.shape[-3]:
            # each covers the `reach` panels before it: so do twice as many
            later, earlier = ends[..., reach:, :, :], ends[..., :-reach, :, :]
            total = later[..., :2] @ earlier
            total[..., 2] += later[..., 2]
            ends = np.concatenate([ends[..., :reach, :, :], total], axis=-3)
            reach *= 2
        return ends

    @property
    def whole(self) -> FloatArray:
        """Affine map of the state over all panels, shape (..., 2, 3)."""
        return np.asarray(self._ends[..., -1, :, :])

    def states(self, start: FloatArray) -> FloatArray:
        """Return the states at the starts of all panels, shape (..., panels, 2)."""
        ends = _applied(self._ends[..., :-1, :, :], start[..., None, :])
        first = np.broadcast_to(start[..., None, :], (*ends.shape[:-2], 1, 2))
        return np.concatenate([first, ends], axis=-2)

    def at(self, states: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z and u at the collocation points, shape (..., panels, points)."""
        return _applied(self.z, states), _applied(self.u, states)


def _applied(maps: FloatArray, state: FloatArray) -> FloatArray:
    """Return what an affine map makes of a state."""
    return np.asarray((maps[..., :2] @ state[..., :, None])[..., 0] + maps[..., 2])


def _panel_maps(
    widths: FloatArray, gamma: float, kappa: FloatArray, push: FloatArray, shift: FloatArray | None
) -> _PanelMaps:
    """Return the motion on each panel.

    Parameters
    ----------
    widths : ndarray, shape (panels,)
    gamma : float
        c T/m.
    kappa : ndarray, shape (..., panels, points)
        k T^2/m.
    push : ndarray, same shape
        What is added to u'.
    shift : ndarray, same shape, optional
        What is added to z'.
    """
    integrals, weights = _integrals(), 0.5 * gauss(POINTS)[1]
    points = integrals.sum(axis=1)
    h = widths[:, None]
    matrix = kappa[..., None] * (h[..., None] ** 2 * (integrals @ integrals))
    matrix += np.eye(POINTS) + gamma * h[..., None] * integrals
    moved = np.zeros(push.shape) if shift is None else h * (shift @ integrals.T)
    sides = np.stack([-kappa, -gamma - kappa * h * points, push - kappa * moved], axis=-1)
    slope = np.linalg.solve(matrix, sides)
    u = h[..., None] * (integrals @ slope)
    u[..., 1] += 1.0
    z = h[..., None] * (integrals @ u)
    z[..., 0] += 1.0
    z[..., 2] += moved
    step = np.empty((*kappa.shape[:-1], 2, 3))
    step[..., 0, :] = h * np.einsum("i,...ij->...j", weights, u)
    step[..., 1, :] = h * np.einsum("i,...ij->...j", weights, slope)
    if shift is not None:
        step[..., 0, 2] += widths * (shift @ weights)
    step[..., 0, 0] += 1.0
    step[..., 1, 1] += 1.0
    return _PanelMaps(z=z, u=u, step=step)


@lru_cache(maxsize=1)
def _integrals() -> FloatArray:
    """Return the matrix from values at the points to integrals from the start of [0, 1] to them."""
    edges = np.array([0.0, 1.0])
    each = PanelCurves.through(edges, np.eye(POINTS)[None]).integral()
    return np.asarray(each.at(panel_nodes(edges, POINTS)[0]).T)


def _unresolved(speed: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the share of the last two Legendre terms, of (turns, panels, points) by turn."""
    series = speed @ gauss(POINTS)[2].T
    power = series**2 / (2 * np.arange(POINTS) + 1) * widths[:, None]
    last, whole = (part.sum(axis=(1, 2)) for part in (power[..., -2:], power))
    return np.asarray(np.sqrt(last / np.where(whole > 0, whole, 1.0)))


def _powers(factor: ComplexArray, start: ComplexArray, count: int) -> ComplexArray:
    """Return start, start factor, start factor^2, ..., shape (count, points)."""
    found = np.empty((count, len(factor)), dtype=np.complex128)
    found[0] = start
    for number in range(1, count):
        np.multiply(found[number - 1], factor, out=found[number])
    return found
