"""Vibration of a mesh in which a few contacts of every turn differ from all others.

With a damaged tooth the stiffness is that of the healthy mesh but for the one to three mesh periods
in which the tooth is in contact. Only these are solved anew; through the rest of the turn what the
tooth has set off dies away as free vibration of the healthy mesh, ``y_{p+1} = M y_p``, so that its
sum over all mesh periods of the turn is a geometric series of 2 x 2 matrices. Every size of damage
is exact, without an expansion in it, and costs the contact of one tooth whatever the gear.

Lines are those of the speed z', which has no jumps that displacement excitation could make
infinite: ``z_r = speed_r / (2 pi i r/P)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError
from gearmon.gears.pulses import gauss
from gearmon.signatures.fault_family_panels import (
    POINTS,
    FloatArray,
    PanelMaps,
    PhaseGrid,
    chained,
    panel_maps,
)

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class EvenMesh:
    """The mesh whose periods are all alike, solved.

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
        growth = float(np.abs(np.linalg.eigvals(self.maps.whole[:, :2])).max())
        if not growth < 1 - 1e-9:
            raise ArgumentError(
                f"free vibrations do not die out, they grow {growth:.9g} times a period: there is "
                f"no steady state; raise damping_ratio or change speed_rpm"
            )

    @cached_property
    def maps(self) -> PanelMaps:
        """Motion on the panels."""
        return self.forced(self.kappa, self.excitation)

    def forced(self, kappa: FloatArray, excitation: FloatArray | None) -> PanelMaps:
        """Return the motion on the panels of mesh periods with other stiffness or excitation."""
        push = np.full(kappa.shape, self.phi)
        if excitation is None:
            return panel_maps(self.grid, self.gamma, kappa, push, None)
        push += (kappa - self.gamma**2) * excitation
        return panel_maps(self.grid, self.gamma, kappa, push, self.gamma * excitation)

    @cached_property
    def monodromy(self) -> FloatArray:
        """M, free vibration over a mesh period, shape (2, 2)."""
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
        return float(_unresolved(self.motion[1][None, None], self.grid)[0])

    def lines(self, highest: int) -> ComplexArray:
        """Return the mesh harmonics 1..highest of z [m]."""
        orders = np.arange(1, highest + 1)
        phase, weights = self.grid.phase.ravel(), self.grid.weights.ravel()
        speed = weights * self.motion[1].ravel()
        found = np.exp(-2j * np.pi * np.outer(orders, phase)) @ speed
        return np.asarray(found / (2j * np.pi * orders))

    @cached_property
    def free(self) -> FloatArray:
        """Speed z' at the points per unit of z and u at the start, shape (panels, points, 2)."""
        parts = [_unforced(part) for part in (self.maps.z, self.maps.u, self.maps.step)]
        bare = PanelMaps(z=parts[0], u=parts[1], step=parts[2])
        return np.stack([bare.at(bare.states(unit))[1] for unit in np.eye(2)], axis=-1)


def _unforced(maps: FloatArray) -> FloatArray:
    bare = maps.copy()
    bare[..., 2] = 0.0
    return bare


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """How turns with a few changed mesh periods differ from an even mesh.

    Parameters
    ----------
    mesh : EvenMesh
    period : int
        P, mesh periods of a turn.
    speed : ndarray of float, shape (turns, W, panels, points)
        Change of z' [m] in the mesh periods 0..W-1 that differ.
    after : ndarray of float, shape (turns, 2)
        Deviation of the state when they end.
    least_force : ndarray of float, shape (turns,)
        Least mesh force over its mean, up to one mesh period after; at or below 0 teeth part.
    """

    mesh: EvenMesh
    period: int
    speed: FloatArray
    after: FloatArray
    least_force: FloatArray

    @property
    def unresolved(self) -> FloatArray:
        """Share of the change of z' in the last two Legendre terms of the panels, (turns,).

        An estimate of the relative error: where the panels suffice the terms fall fast, and what
        is left out is less than what is still seen.
        """
        return _unresolved(self.speed, self.mesh.grid)

    def lines(self, highest: int) -> ComplexArray:
        """Return the harmonics 1..highest of the turn of the change of z [m], (turns, highest)."""
        period, window = self.period, self.speed.shape[1]
        speed = self.speed.reshape(len(self.after), window, -1)
        free = self.mesh.free.reshape(-1, 2)
        grid = self.mesh.grid
        phase, weights = grid.phase.ravel(), grid.weights.ravel()
        meshes = np.arange(highest // period + 1)
        turned = np.exp(-2j * np.pi * np.outer(meshes, phase)) * weights
        found = np.zeros((len(speed), highest + 1), dtype=np.complex128)
        for r in range(min(period, highest + 1)):
            slow = np.exp(-2j * np.pi * r / period * np.arange(window))
            sums = np.tensordot(speed, slow, axes=(1, 0)) + (self._rest(r) @ free.T)
            sums *= np.exp(-2j * np.pi * r / period * phase)
            count = (highest - r) // period + 1
            found[:, r::period] = sums @ turned[:count].T
        return np.asarray(found[:, 1:] / (2j * np.pi * np.arange(1, highest + 1)))

    def _rest(self, r: int) -> ComplexArray:
        """Sum over the mesh periods W..P-1 of state and turning factor, shape (turns, 2)."""
        left = self.period - self.speed.shape[1]
        if not left:
            return np.zeros((len(self.after), 2), dtype=np.complex128)
        unit = np.exp(-2j * np.pi * r / self.period)
        free = self.mesh.monodromy
        series = np.linalg.solve(
            np.eye(2) - unit * free,
            np.eye(2) - unit**left * np.linalg.matrix_power(free, left),
        )
        # unit^W is the place of the first of them
        return np.asarray(unit ** self.speed.shape[1] * (self.after @ series.T))


def _unresolved(speed: FloatArray, grid: PhaseGrid) -> FloatArray:
    series = speed @ gauss(POINTS)[2].T
    power = series**2 / (2 * np.arange(POINTS) + 1) * grid.widths[:, None]
    last, whole = (part.sum(axis=(1, 2, 3)) for part in (power[..., -2:], power))
    return np.asarray(np.sqrt(last / np.where(whole > 0, whole, 1.0)))


def deviations(
    mesh: EvenMesh, period: int, kappa: FloatArray, excitation: FloatArray | None
) -> Deviations:
    """Solve turns in which the first W mesh periods differ.

    Parameters
    ----------
    mesh : EvenMesh
        Without excitation.
    period : int
        P >= W.
    kappa : ndarray, shape (turns, W, panels, points)
        k T^2/m in these periods.
    excitation : ndarray, same shape, optional
        e [m] in these periods; zero in the others.
    """
    maps = mesh.forced(kappa, excitation)
    own = maps.whole.copy()
    own[..., 2] += (own[..., :2] - np.eye(2)) @ mesh.start
    state, speeds, forces = _start(mesh, period, own), [], []
    for number in range(kappa.shape[1]):
        part = maps.of_period(number)
        states = part.states(mesh.start + state)
        z, speed = part.at(states)
        if excitation is not None:
            z = z - excitation[:, number]
            speed = speed + mesh.gamma * excitation[:, number]
        forces.append(kappa[:, number] * z + mesh.gamma * speed)
        speeds.append(speed - mesh.motion[1])
        state = states[:, -1] - mesh.start
    z, speed = mesh.maps.at(mesh.maps.states(mesh.start + state))
    forces.append(mesh.kappa * z + mesh.gamma * speed)
    least = np.min([force.min(axis=(1, 2)) / mesh.phi for force in forces], axis=0)
    return Deviations(
        mesh=mesh, period=period, speed=np.stack(speeds, axis=1), after=state, least_force=least
    )


def linear_deviations(mesh: EvenMesh, period: int, lost: FloatArray) -> Deviations:
    """Answer turns to first order in the stiffness lost in their first W mesh periods.

    Parameters
    ----------
    mesh : EvenMesh
    period : int
    lost : ndarray, shape (turns, W, panels, points)
        -d(k T^2/m), positive where stiffness is lost.
    """
    z0 = mesh.motion[0]
    kappa = np.broadcast_to(mesh.kappa, lost.shape)
    maps = panel_maps(mesh.grid, mesh.gamma, kappa, lost * z0, None)
    state, speeds = _start(mesh, period, maps.whole), []
    for number in range(lost.shape[1]):
        part = maps.of_period(number)
        states = part.states(state)
        speeds.append(part.at(states)[1])
        state = states[:, -1, :]
    return Deviations(
        mesh=mesh,
        period=period,
        speed=np.stack(speeds, axis=1),
        after=state,
        least_force=np.full(len(lost), mesh.least_force),
    )


def _start(mesh: EvenMesh, period: int, changed: FloatArray) -> FloatArray:
    """Return the deviation with which a turn begins, shape (turns, 2).

    `changed`, shape (turns, W, 2, 3), maps the deviation through each of its first W periods.
    """
    total = changed[:, 0]
    for number in range(1, changed.shape[1]):
        total = chained(changed[:, number], total)
    rest = np.linalg.matrix_power(mesh.monodromy, period - changed.shape[1])
    total = rest @ total
    return np.asarray(np.linalg.solve(np.eye(2) - total[..., :2], total[..., 2:])[..., 0])
