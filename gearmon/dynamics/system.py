"""Many coordinates and several meshes on one period: problem, vibration, tongues, integration.

    M q'' + (C + G) q' + [K + sum_j k_j(t) v_j v_j^T] q = F + f(t)
    k_j(t) = k_j [1 + phi_j(t)],    phi_j(t) = sum_i (c_ji e^{iiwt} + conjugate),    w = 2 pi/T

Mesh j is deflected by d_j = v_j . q, positive where the teeth are pressed together. Meshes of
different frequency share a period in which all of them repeat.

Integration in time needs no theory and bounds no error, but follows start-up and teeth that part.
The force of a mesh, counted in the direction in which the steady load presses it, is

    max(0, k(t) d + c d') + min(0, k(t) (d + b) + c d'),    b the backlash,

so that the masses fly freely until spring and damper would press again, on either flank. A pair is
a machine of one mesh and one coordinate.

Combination tongues. With modes of unit mass, D^(l) = Phi^T [sum_j k_j c_jl v_j v_j^T] Phi of the
l-th harmonic of the stiffness couples mode p to mode q where l w = w_p + w_q (p = q: principal
resonance). To first order of multiple scales, with z_p = A_p e^{i w_p t} + conjugate,

    A_p' = -mu_p A_p + i D_pq/(2 w_p) conj(A_q) e^{i s t},    s = l w - w_p - w_q

and the same with p and q exchanged. With kappa = |D_pq|/(2 sqrt(w_p w_q)) free vibrations grow for

    |s| < (mu_p + mu_q) sqrt(kappa^2/(mu_p mu_q) - 1),    undamped |s| < 2 kappa.

Where modes share a frequency, as the translational ones of planetary sets, D is a block and its
singular values take the place of |D_pq|. Differences of frequencies do not occur, because D is
symmetric. The error is of second order in the variation of stiffness.

Source: Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5; for gears Lin and Parker,
J. Vib. Acoust. 124 (2002) 68.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from gearmon.arrays import BoolArray, IntArray
from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import (
    HillProblem,
    PeriodicVibration,
    check_entries,
    check_swing,
    least_over_mean,
)
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.result import Result

#: Share of the largest eigenvalue below which a mode is a rigid one: rounding of the eigenvalues of
#: 40 coordinates is some 1e-14.
RIGID = 1e-11
#: Share of it from which on a negative eigenvalue is no rounding.
NEGATIVE = 1e-9
#: Unsymmetric part of a matrix that is taken for rounding.
SYMMETRIC = 1e-9


@dataclass(frozen=True, eq=False)
class HillSystem:
    """Masses on springs, some of them meshes of periodic stiffness.

    Parameters
    ----------
    mass, damping, stiffness : float array, shape (n, n)
        M, C, K without the meshes, all symmetric. With lengths as coordinates (u = r theta for a
        rotation) [kg, N s/m, N/m].
    mesh_vectors : float array, shape (meshes, n)
        v_j, one row each.
    mesh_stiffness_n_per_m : float array, shape (meshes,)
        k_j > 0, means.
    mesh_harmonics : complex array, shape (meshes, J)
        c_j1..c_jJ, relative to the mean; a single row is taken for all meshes.
    period_s : float
        T > 0.
    force_n : float array, shape (n,)
        F, constant; on a rigid-body motion it must do no work.
    gyroscopic : float array, shape (n, n), optional
        G, skew-symmetric [N s/m].
    force_harmonics_n : complex array, shape (lines, n), optional
        f_1, f_2, ... of f(t) = sum (f_i e^{iiwt} + conjugate).
    mesh_damping_ns_per_m : float array, shape (meshes,), optional
        Dampers >= 0 between the teeth, beside `damping` [N s/m].

    Raises
    ------
    ArgumentError
        If shapes do not fit, a value is not finite or out of its range, or the machine with mean
        stiffnesses has no equilibrium.

    Examples
    --------
    >>> pair = HillSystem(0.28, 9e3, 0.0, 1.0, 8e8, [[0.065]], 1.6e-3, 4e3)
    >>> float(pair.natural_frequencies_hz[0].round(2))
    8507.19
    """

    mass: Real
    damping: Real
    stiffness: Real
    mesh_vectors: Real
    mesh_stiffness_n_per_m: Real
    mesh_harmonics: Complex
    period_s: float
    force_n: Real
    gyroscopic: Real = None  # type: ignore[assignment]
    force_harmonics_n: Complex = None  # type: ignore[assignment]
    mesh_damping_ns_per_m: Real = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        check_positive("period_s", self.period_s, "s")
        # n and m, as the first that has them; what is left out is filled in with zeros
        sizes: dict[str, int] = {}
        for name, (kind, axes) in _FIELDS.items():
            given: npt.ArrayLike | None = getattr(self, name)
            if given is None:
                given = np.zeros([sizes.get(axis, 0) for axis in axes])
            array: npt.NDArray[Any] = np.array(given, kind, ndmin=len(axes))
            if name == "mesh_harmonics" and len(array) == 1:
                array = np.repeat(array, sizes["m"], axis=0)
            own = {a: n for a, n in zip(axes, array.shape, strict=False) if a != "J"}
            sizes = own | sizes
            wanted = tuple(map(sizes.get, axes, array.shape))
            if array.shape != wanted:
                raise ArgumentError(f"{name}: shape {array.shape} must be {wanted}")
            check_entries(name, array)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        for name in ("mass", "damping", "stiffness", "gyroscopic"):
            matrix, sign = getattr(self, name), -1.0 if name == "gyroscopic" else 1.0
            apart = float(np.abs(matrix - sign * matrix.T).max())
            if apart > SYMMETRIC * float(np.abs(matrix).max()):
                like = "symmetric" if sign > 0 else "skew-symmetric"
                raise ArgumentError(f"{name}: must be {like}, but entries differ by {apart:.4g}")
        if (self.mesh_damping_ns_per_m < 0).any():
            raise ArgumentError("mesh_damping_ns_per_m: all values must be >= 0 N s/m")
        if not (len(self.mesh_vectors) and (self.mesh_stiffness_n_per_m > 0).all()):
            raise ArgumentError("mesh_stiffness_n_per_m: all values must be > 0 N/m, one at least")
        check_swing("mesh_harmonics", self.mesh_harmonics)
        least = float(np.linalg.eigvalsh(self.damping)[0])
        if least < -SYMMETRIC * np.abs(self.damping).max():
            raise ArgumentError(f"damping: its least eigenvalue {least:.4g} N s/m must be >= 0")
        self._check_equilibrium()

    def _check_equilibrium(self) -> None:
        squares = self.modes[0]
        if squares[0] < 0:
            raise ArgumentError(
                f"stiffness: the machine with mean mesh stiffnesses has a mode of negative "
                f"stiffness (square of its frequency {squares[0]:.4g} 1/s2): it has no equilibrium"
            )
        rigid = self.modes[1][:, self.rigid]
        work = np.abs(rigid.T @ self.force_n)
        size = np.linalg.norm(rigid, axis=0) * np.linalg.norm(self.force_n)
        if (work > 1e-9 * size).any():
            raise ArgumentError(
                "force_n: it does work on a rigid-body motion and would drive it away; balance the "
                "forces, or hold the machine by a stiffness"
            )

    @property
    def angular_frequency(self) -> float:
        """Angular frequency w = 2 pi/T [rad/s]."""
        return 2 * math.pi / self.period_s

    @cached_property
    def mean_stiffness(self) -> Real:
        """K with the means of all meshes, shape (n, n)."""
        v = self.mesh_vectors
        return np.asarray(self.stiffness + v.T @ (self.mesh_stiffness_n_per_m[:, None] * v))

    @cached_property
    def velocity_matrix(self) -> Real:
        """Damping with that of all meshes and gyroscopic terms, shape (n, n)."""
        v = self.mesh_vectors
        meshes = v.T @ (self.mesh_damping_ns_per_m[:, None] * v)
        return np.asarray(self.damping + meshes + self.gyroscopic)

    @cached_property
    def modes(self) -> tuple[Real, Real]:
        """Squares of the angular natural frequencies [1/s2], ascending, and modes of unit mass.

        Undamped, with mean stiffnesses and without gyroscopic terms; one mode to a column. Of
        rigid-body motions the squares are zero.

        Raises
        ------
        ArgumentError
            If the mass matrix is not positive definite.
        """
        try:
            squares, shapes = scipy.linalg.eigh(self.mean_stiffness, self.mass)
        except np.linalg.LinAlgError:
            raise ArgumentError("mass: the matrix must be positive definite") from None
        rigid = (squares > -NEGATIVE * squares[-1]) & (squares < RIGID * squares[-1])
        return np.where(rigid, 0.0, squares), np.asarray(shapes)

    @property
    def rigid(self) -> BoolArray:
        """Which modes are rigid-body motions, shape (n,)."""
        return np.asarray(self.modes[0] == 0)

    @property
    def natural_frequencies_hz(self) -> Real:
        """Natural frequencies with mean stiffnesses [Hz], ascending, shape (n,)."""
        return np.asarray(np.sqrt(self.modes[0]) / (2 * math.pi))


#: Kind of number, and axes: n coordinates, m meshes, or any number of J harmonics.
_FIELDS = {
    "mass": (float, "nn"),
    "damping": (float, "nn"),
    "stiffness": (float, "nn"),
    "mesh_vectors": (float, "mn"),
    "mesh_stiffness_n_per_m": (float, "m"),
    "mesh_damping_ns_per_m": (float, "m"),
    "mesh_harmonics": (complex, "mJ"),
    "force_n": (float, "n"),
    "gyroscopic": (float, "nn"),
    "force_harmonics_n": (complex, "Jn"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemResponse(PeriodicVibration):
    """Steady vibration of a `HillSystem`.

    Attributes
    ----------
    system : HillSystem
        What was solved.
    displacement : complex ndarray, shape (N+1, n)
        q_0..q_N [m]. Rigid-body motions are given without their mean.
    mesh_force : complex ndarray, shape (N+1, meshes)
        Force between the teeth k_j(t) d_j + c_j d_j' [N].
    floquet_multipliers : complex ndarray, shape (modes,)
        Factors by which free vibrations change over a period, the largest modulus first; free
        rigid-body motions left out.
    """

    system: HillSystem
    mesh_force: Complex
    floquet_multipliers: Complex

    @property
    def _period_s(self) -> float:
        return self.system.period_s

    @property
    def mesh_deflection(self) -> Complex:
        """Lines of d_j = v_j . q [m], shape (N+1, meshes)."""
        return self.displacement @ self.system.mesh_vectors.T

    def spring_force(self, vectors: npt.ArrayLike, stiffness_n_per_m: npt.ArrayLike) -> Complex:
        """Lines of the forces of springs of constant stiffness, such as bearings.

        Parameters
        ----------
        vectors : float array, shape (springs, n)
            Their deflections are vectors @ q; dimensionless.
        stiffness_n_per_m : float array, shape (springs,)

        Returns
        -------
        complex ndarray, shape (N+1, springs)
            [N].
        """
        moved: Complex = self.displacement @ np.atleast_2d(np.asarray(vectors, dtype=float)).T
        return np.asarray(moved * np.asarray(stiffness_n_per_m))

    @cached_property
    def mesh_force_margin(self) -> Real:
        """Smallest force of every mesh over its mean [1]; <= 0 where contact is lost."""
        return np.array([least_over_mean(force) for force in self.mesh_force.T])

    @property
    def contact_lost(self) -> BoolArray:
        """Whether a mesh force passes zero, shape (meshes,): there the linear model ends."""
        return np.asarray(self.mesh_force_margin <= 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeHistory(Result):
    """A vibration as a time series.

    Attributes
    ----------
    time_s : float ndarray, shape (M,)
    displacement, velocity, acceleration : float ndarray, shape (M, n)
        [m], [m/s], [m/s2], the acceleration by the equation of motion.
    mesh_force : float ndarray, shape (M, meshes)
        [N], positive where the teeth are pressed together.
    apart : bool ndarray, shape (M, meshes)
        Where the teeth are apart.
    evaluations : int
        Calls of the right side.
    """

    time_s: Real
    displacement: Real
    velocity: Real
    acceleration: Real
    mesh_force: Real
    apart: BoolArray
    evaluations: int


def system_of(p: HillProblem) -> HillSystem:
    """Return a pair as a machine of one coordinate, its damper between the teeth."""
    return HillSystem(
        np.array(p.mass_kg),
        np.zeros(1),
        np.zeros(1),
        np.ones(1),
        np.array(p.stiffness_n_per_m),
        p.stiffness_harmonics[None],
        p.period_s,
        np.array(p.force_n),
        force_harmonics_n=p.force_harmonics_n[:, None],
        mesh_damping_ns_per_m=np.array(p.damping_ns_per_m),
    )


def integrate(
    problem: HillProblem | HillSystem,
    time_s: npt.ArrayLike,
    state: npt.ArrayLike | None = None,
    backlash_m: float | None = None,
    relative_tolerance: float = 1e-9,
) -> TimeHistory:
    """Vibration from a state at the first of some times on.

    Parameters
    ----------
    problem : HillProblem or HillSystem
        The equation.
    time_s : float array, shape (M,)
        Ascending.
    state : float array, shape (2 n,), optional
        Displacements [m], then velocities [m/s]; by default all 0.
    backlash_m : float, optional
        b >= 0 of all meshes, `math.inf` for teeth that only part. By default the teeth stay
        together: the linear equation, also where it pulls.
    relative_tolerance : float
        Relative, of every step, 2.3e-14 to 0.1, by DOP853.

    Returns
    -------
    TimeHistory

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the solver fails.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> h = integrate(p, [0.0, 4e-4, 8e-4])
    >>> h.displacement.shape, float(h.displacement[0, 0]), float(round(h.acceleration[0, 0]))
    ((3, 1), 0.0, 14286.0)
    """
    check_range("relative_tolerance", relative_tolerance, 2.3e-14, 0.1)
    if backlash_m is not None and not backlash_m >= 0:
        raise ArgumentError(f"backlash_m={backlash_m} m must be >= 0")
    system = system_of(problem) if isinstance(problem, HillProblem) else problem
    equation, n = _Equation(system, backlash_m), len(system.mass)
    times = np.asarray(time_s, dtype=np.float64)
    start = np.zeros(2 * n) if state is None else np.asarray(state, dtype=np.float64)
    if start.shape != (2 * n,) or not np.isfinite(start).all():
        raise ArgumentError(f"state: {start} must be {2 * n} finite numbers")
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0).all():
        raise ArgumentError("time_s: must be a row of ascending times, two at least")
    size = relative_tolerance * equation.deflection
    found = scipy.integrate.solve_ivp(
        lambda t, x: np.concatenate([x[n:], equation.rates(t, x)[0]]),
        (times[0], times[-1]),
        start,
        method="DOP853",
        t_eval=times,
        rtol=relative_tolerance,
        atol=np.repeat([size, size * equation.fastest], n) * 1e-2,
    )
    if not found.success:
        raise ArgumentError(f"integration failed at {found.t[-1]:.6g} s: {found.message}")
    values = [equation.rates(t, x) for t, x in zip(times, found.y.T, strict=True)]
    rates, forces, apart = (np.array([row[i] for row in values]) for i in range(3))
    return TimeHistory(
        time_s=times,
        displacement=found.y[:n].T,
        velocity=found.y[n:].T,
        acceleration=rates,
        mesh_force=forces,
        apart=apart,
        evaluations=found.nfev,
    )


class _Equation:
    """Right side of the equations of motion; meshes are left to their own law."""

    def __init__(self, system: HillSystem, backlash_m: float | None) -> None:
        self.system, self.backlash = system, backlash_m
        self.inverse = np.linalg.inv(system.mass)
        self.damping = system.damping + system.gyroscopic
        # swings of the stiffnesses, and below them of the forces
        own, given = system.mesh_harmonics, system.force_harmonics_n.T
        self.harmonics = np.zeros(
            (len(own) + len(given), max(own.shape[1], given.shape[1])), complex
        )
        self.harmonics[: len(own), : own.shape[1]] = 2 * own
        self.harmonics[len(own) :, : given.shape[1]] = 2 * given
        self.turning = 1j * system.angular_frequency * np.arange(1, self.harmonics.shape[1] + 1)
        at_rest = np.linalg.pinv(system.mean_stiffness, rcond=1e-9) @ system.force_n
        self.sign = np.where(system.mesh_vectors @ at_rest < 0, -1.0, 1.0)
        #: sizes of a deflection and a rate, for what is small beside them
        self.deflection = float(np.abs(at_rest).max()) or 1.0
        self.fastest = 2 * math.pi * float(system.natural_frequencies_hz[-1])

    def rates(self, time: float, state: Real) -> tuple[Real, Real, BoolArray]:
        """Accelerations, mesh forces, and whether teeth are apart."""
        s, (place, velocity) = self.system, state.reshape(2, -1)
        swing = (self.harmonics @ np.exp(time * self.turning)).real
        stiffness = s.mesh_stiffness_n_per_m * (1 + swing[: len(self.sign)])
        deflection, rate = s.mesh_vectors @ place, s.mesh_vectors @ velocity
        push = self.sign * (stiffness * deflection + s.mesh_damping_ns_per_m * rate)
        apart = np.zeros(len(push), dtype=bool)
        if self.backlash is not None:
            # an endless way leaves no back flank
            back = np.minimum(0.0, push + stiffness * min(self.backlash, 1e100))
            apart = (push < 0) & (back == 0)
            push = np.maximum(0.0, push) + np.where(push < 0, back, 0.0)
        forces = self.sign * push
        load = s.force_n + swing[len(self.sign) :] - s.mesh_vectors.T @ forces
        resisting = s.stiffness @ place + self.damping @ velocity
        return self.inverse @ (load - resisting), forces, apart


#: Frequencies that agree so closely are one: rounding of eigenvalues is far below.
SAME = 1e-6
#: A coupling below this share of the largest is rounding.
NO_COUPLING = 1e-9


@dataclass(frozen=True, kw_only=True)
class CombinationTongue:
    """Where two modes are unstable together.

    Attributes
    ----------
    harmonic : int
        l, of the stiffness.
    modes : (int, int)
        p <= q, the first of each frequency, counted from 0 in ascending order.
    frequency_hz : float
        Centre: 1/T at which l/T is the sum of both natural frequencies.
    half_width_hz : float
        Half width in 1/T; 0 where damping closes the tongue.
    coupling_per_s : float
        kappa [1/s]: rate of growth at the centre without damping.
    damping_per_s : (float, float)
        mu_p and mu_q [1/s].
    """

    harmonic: int
    modes: tuple[int, int]
    frequency_hz: float
    half_width_hz: float
    coupling_per_s: float
    damping_per_s: tuple[float, float]


def combination_tongues(system: HillSystem) -> list[CombinationTongue]:
    """Principal and combination instabilities of first order, the widest first.

    Parameters
    ----------
    system : HillSystem
        Its own period does not matter: the tongues say at which it is unstable. Gyroscopic terms
        are left out.

    Returns
    -------
    list of Tongue
        Every pair of modes that some harmonic couples, damped shut or not.

    Examples
    --------
    >>> pair = HillSystem(0.28, 0.0, 0.0, 1.0, 8e8, [[0.065]], 1.6e-3, 4e3)
    >>> tongue = combination_tongues(pair)[0]
    >>> round(tongue.half_width_hz / tongue.frequency_hz, 6)    # eps/4 of 2 w0
    0.0325
    """
    squares, shapes = system.modes
    natural = np.sqrt(squares)
    damping = 0.5 * np.diag(shapes.T @ system.velocity_matrix @ shapes)
    # modes of one frequency together, rigid-body motions left out
    elastic = np.flatnonzero(natural)
    rising = natural[elastic]
    groups = np.split(elastic, np.flatnonzero(np.diff(rising) > SAME * rising[1:]) + 1)
    meshes = shapes.T @ system.mesh_vectors.T
    found = []
    for index, c in enumerate(system.mesh_harmonics.T):
        coupling = meshes @ ((system.mesh_stiffness_n_per_m * c)[:, None] * meshes.T)
        for i, p in enumerate(groups):
            for q in groups[i:]:
                sizes = np.linalg.svd(coupling[np.ix_(p, q)], compute_uv=False)
                found += _tongues(index + 1, p, q, sizes, natural, damping)
    most = max((tongue.coupling_per_s for tongue in found), default=0.0)
    open_ = [tongue for tongue in found if tongue.coupling_per_s > NO_COUPLING * most]
    return sorted(open_, key=lambda tongue: (-tongue.half_width_hz, -tongue.coupling_per_s))


def _tongues(
    harmonic: int, p: IntArray, q: IntArray, sizes: Real, natural: Real, damping: Real
) -> list[CombinationTongue]:
    """One tongue for every different coupling of two frequencies."""
    one, other = float(natural[p[0]]), float(natural[q[0]])
    rates = float(damping[p].mean()), float(damping[q].mean())
    found: list[CombinationTongue] = []
    for size in sizes:
        kappa = float(size) / (2 * math.sqrt(one * other))
        if found and found[-1].coupling_per_s - kappa <= SAME * kappa:
            continue
        width = 2 * kappa
        if min(rates) > 0:
            excess = kappa**2 / (rates[0] * rates[1]) - 1
            width = sum(rates) * math.sqrt(max(0.0, excess))
        found.append(
            CombinationTongue(
                harmonic=harmonic,
                modes=(int(p[0]), int(q[0])),
                frequency_hz=(one + other) / (2 * math.pi * harmonic),
                half_width_hz=width / (2 * math.pi * harmonic),
                coupling_per_s=kappa,
                damping_per_s=rates,
            )
        )
    return found
