"""What the meshes feel of the machine around them: its dynamic compliance, line by line.

With u_j = sqrt(k_j) d_j the deflections of the meshes and x_j the swing of their forces over
sqrt(k_j), the lines obey u_n = u0_n + G(n w) x_n, where u0 answers the forces alone and

    G(n w) = S^T [K_mean - (n w)^2 M + i n w (C + G)]^-1 S,    S = columns sqrt(k_j) v_j.

Of a single pair G is the number 1/D_n, D_n = 1 - (n/R)^2 + 2 i zeta n/R (`PairCompliance`); of a
machine a matrix of meshes (`SystemCompliance`).
Both give the same to `mesh_equations`:

answer(x), motion(x)        G x, and the motion of all coordinates that x makes; both also of the
                            lines from `first` on alone
state(x)                    deflections and motion under the forces and x together
weights(N)                  acceleration per displacement of lines 0..N
size(half), per_line(half)  rms over the period, and modulus of every line, all rows together
most_from(n)                bounds of |G|, and of acceleration over x, of all lines from n on
quiet_above(level)          line above which |G| <= level
matrices(count)             G of lines 0..count-1
together(pattern, right)    lines of (1 + phi G) x = right solved at once: harmonic balance

Beyond about twice the highest natural frequency w_h, where no line of a machine is computed,
|G| <= |S^T M^-1 S|/(w^2 - w_h^2 - w g) with g the size of the gyroscopic terms, because the real
part of the dynamic stiffness is no smaller.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import cached_property

import numpy as np
import scipy

from gearmon.dynamics.error_bound import Pattern
from gearmon.dynamics.fourier import (
    UNIT_ROUNDOFF,
    Complex,
    Real,
    fast_length,
    rms_of_each,
    samples,
    with_zero_mean,
)
from gearmon.dynamics.hill import dynamic_stiffness, largest_responses
from gearmon.dynamics.system import HillSystem
from gearmon.errors import ArgumentError

BYTES_ALLOWED, BYTES_OF_BANDS = 1e9, 2e8
#: Unknowns of a matrix that is inverted or solved: 3000 take 70 MB and some seconds.
MOST_UNKNOWNS = 3000
#: Rounds of inverse iteration: some percent of the least singular value are left.
ITERATIONS = 8
#: Lines of the compliance of a machine that are computed at most.
MOST_LINES = 20_000


class PairCompliance:
    """One mesh; or, for `shooting`, many pairs.

    Parameters
    ----------
    ratio, zeta : float ndarray, shape (1,) or (B,)
        R = w0/w and damping ratio.
    forces : complex ndarray, shape (G+1,)
        (F, f_1..f_G)/k0 [m].
    """

    #: shape of what comes before the lines, and roundings of one answer
    rows: tuple[int, ...] = ()
    depth = 4.0

    def __init__(self, ratio: Real, zeta: Real, forces: Complex) -> None:
        self.ratio, self.zeta, self.forces = ratio, zeta, forces
        #: rms of the forces without their mean
        self.swinging_forces = math.sqrt(2 * np.vdot(forces[1:], forces[1:]).real)
        self._stiffness: Complex = np.zeros(0, dtype=complex)

    def stiffness(self, highest: int) -> Complex:
        """D_n of the lines 0..highest, relative to k0, shape (..., highest+1)."""
        if self._stiffness.shape[-1] <= highest:
            self._stiffness = dynamic_stiffness(self.ratio, self.zeta, highest)
        return self._stiffness[..., : highest + 1]

    def weights(self, highest: int) -> Real:
        """(n/R)^2, shape (..., highest+1)."""
        return np.asarray((np.arange(highest + 1) / self.ratio) ** 2)

    def answer(self, x: Complex, first: int = 0) -> Complex:
        """x/D of the lines from `first` on, 0 below."""
        answer = np.zeros(x.shape, dtype=complex)
        outer = slice(first, None)
        stiffness = self.stiffness(x.shape[-1] - 1)
        np.divide(x[..., outer], stiffness[..., outer], out=answer[..., outer])
        return answer

    motion = answer

    def state(self, x: Complex) -> tuple[Complex, Complex]:
        """Deflections, twice, since they are the motion."""
        u = self.answer(x)
        count = min(len(self.forces), u.shape[-1])
        u[..., :count] += self.forces[:count] / self.stiffness(u.shape[-1] - 1)[..., :count]
        return u, u

    def size(self, half: Complex) -> Real:
        """Rms."""
        return rms_of_each(half)

    def per_line(self, half: Complex) -> Real:
        """Modulus."""
        return np.abs(half)

    def most_from(self, line: int) -> tuple[float, float]:
        """Largest 1/|D| and (n/R)^2/|D| of all lines from one on."""
        return largest_responses(float(self.ratio[0]), float(self.zeta[0]), 0.0, line)

    def quiet_above(self, level: float) -> int:
        """Line above which 1/|D| <= level for certain."""
        return math.ceil(float(self.ratio[0]) * math.sqrt(1 + 1 / level))

    def matrices(self, count: int) -> Complex:
        """1/D, shape (count, 1, 1)."""
        return np.asarray(1 / self.stiffness(count - 1)[:, None, None])

    def together(self, pattern: Pattern, right: Complex) -> Complex:
        """Solve all lines at once, by a band matrix."""
        z = solve_band(self.stiffness(len(right) - 1), pattern.harmonics, right)
        return np.asarray(self.stiffness(len(right) - 1) * z)


def solve_band(stiffness: Complex, harmonics: Complex, right: Complex) -> Complex:
    """Lines 0..N of D_n z_n + sum_m phi_{n-m} z_m = g_n, n = -N..N: harmonic balance.

    Parameters
    ----------
    stiffness, right : complex ndarray, shape (N+1,)
        D_n and g_n, their conjugates standing below 0.
    harmonics : complex ndarray, shape (J,)

    Raises
    ------
    ArgumentError
        If the matrix would not fit in memory; the orders of multiple scales need none.
    """
    highest = len(right) - 1
    c = harmonics[: 2 * highest]
    width = len(c)
    bytes_needed = 16 * (2 * highest + 1) * (3 * width + 1)
    if bytes_needed > BYTES_ALLOWED:
        raise ArgumentError(
            f"harmonic balance of {highest} harmonics with {width} stiffness harmonics needs "
            f"{bytes_needed / 1e9:.1f} GB; use method='auto', which stores no matrix"
        )
    bands = np.zeros((2 * width + 1, 2 * highest + 1), dtype=complex)
    bands[width] = np.concatenate([stiffness[:0:-1].conj(), stiffness])
    bands[:width], bands[width + 1 :] = c[::-1].conj()[:, None], c[:, None]
    full = np.concatenate([right[:0:-1].conj(), right])
    solution: Complex = scipy.linalg.solve_banded((width, width), bands, full, check_finite=False)
    return solution[highest:]


class SystemCompliance:
    """Several meshes in one machine with mean stiffnesses.

    Parameters
    ----------
    system : HillSystem

    Raises
    ------
    ArgumentError
        If the period is so long that the highest natural frequency lies too many lines up.
    """

    swinging_forces = 0.0

    def __init__(self, system: HillSystem) -> None:
        self.system = system
        self.squares, self.shapes = system.modes
        self.damping = self.shapes.T @ system.velocity_matrix @ self.shapes
        scale = np.sqrt(system.mesh_stiffness_n_per_m)
        #: mesh vectors in modal coordinates times sqrt(k_j), shape (n, meshes)
        self.meshes = self.shapes.T @ (system.mesh_vectors * scale[:, None]).T
        self.rows = (len(scale),)
        self.depth = 8.0 + len(self.squares)
        self._lines: Complex = np.zeros((0, *self.meshes.shape), dtype=complex)
        self._matrices: Complex = np.zeros((0, *self.rows, *self.rows), dtype=complex)
        if self.far > MOST_LINES:
            raise ArgumentError(
                f"period_s={system.period_s} s: the highest natural frequency "
                f"{system.natural_frequencies_hz[-1]:.4g} Hz lies more than {MOST_LINES // 2} "
                "lines up; leave out what is so stiff, or take a shorter period"
            )

    @cached_property
    def far(self) -> int:
        """Line from which on the bounds for high frequencies hold and are within a factor of 2."""
        turning = float(np.linalg.norm(self.shapes.T @ self.system.gyroscopic @ self.shapes, 2))
        top = turning + math.sqrt(turning**2 + 2 * float(self.squares[-1]))
        return math.ceil(top / self.system.angular_frequency) + 1

    def _modal(self, count: int) -> Complex:
        """Modal answers to unit mesh forces over sqrt(k_j), shape (count, n, meshes)."""
        known = len(self._lines)
        if count > known:
            more = max(count, 2 * known) if known else count
            new = self._answers(np.arange(known, more, dtype=float), self.meshes[None])
            self._lines = np.concatenate([self._lines, new])
        return self._lines[:count]

    def _answers(self, lines: Real, forces: Complex | Real) -> Complex:
        """Modal answers to modal forces, shape (lines, n, ...)."""
        w = self.system.angular_frequency * lines[:, None]
        diagonal = self.squares - w**2 + 0j
        if lines[0] == 0:
            # a rigid-body motion has no mean
            diagonal[0, self.system.rigid] = np.inf
        off = self.damping - np.diag(np.diag(self.damping))
        if np.abs(off).max() <= 1e-12 * np.abs(self.damping).max():
            diagonal += 1j * w * np.diag(self.damping)
            return np.asarray(forces / diagonal[..., None])
        matrix = 1j * w[:, :, None] * self.damping
        where = np.arange(len(self.squares))
        matrix[:, where, where] += np.where(np.isinf(diagonal), 1.0, diagonal)
        stacked = np.broadcast_to(forces, (len(lines), *np.shape(forces)[1:]))
        found = np.linalg.solve(matrix, stacked)
        found[np.isinf(diagonal)] = 0
        return np.asarray(found)

    @cached_property
    def _forced(self) -> Complex:
        """Modal answers to the forces alone, shape (n, lines)."""
        forces = np.concatenate([self.system.force_n[None], self.system.force_harmonics_n])
        lines = np.arange(len(forces), dtype=float)
        return np.asarray(self._answers(lines, (forces @ self.shapes)[..., None])[..., 0].T)

    @property
    def forces(self) -> Complex:
        """One entry for every line that forces drive."""
        return np.asarray(self._forced[0])

    def weights(self, highest: int) -> Real:
        """(n w)^2 [1/s2], shape (highest+1,)."""
        return np.asarray((self.system.angular_frequency * np.arange(highest + 1)) ** 2)

    def answer(self, x: Complex, first: int = 0) -> Complex:
        """G x of the lines from `first` on, shape (meshes, N+1)."""
        u = (self.matrices(x.shape[1]) @ x.T[:, :, None])[:, :, 0].T
        return np.where(np.arange(x.shape[1]) < first, 0, u) if first else np.ascontiguousarray(u)

    def motion(self, x: Complex, first: int = 0) -> Complex:
        """Lines of all coordinates, those from `first` on, shape (n, N+1)."""
        modal = np.einsum("lnm,ml->nl", self._modal(x.shape[1])[first:], x[:, first:])
        return np.asarray(self.shapes @ np.pad(modal, [(0, 0), (first, 0)]))

    def state(self, x: Complex) -> tuple[Complex, Complex]:
        """Deflections (meshes, N+1) and motion (n, N+1)."""
        u, q, still = self.answer(x), self.motion(x), self._forced[:, : x.shape[1]]
        u[:, : still.shape[1]] += self.meshes.T @ still
        q[:, : still.shape[1]] += self.shapes @ still
        for half in (u, q):
            half[:, 0] = half[:, 0].real
        return u, q

    def size(self, half: Complex) -> Real:
        """Root of the sum of the mean squares of all rows."""
        return np.asarray(np.linalg.norm(rms_of_each(half)))

    def per_line(self, half: Complex) -> Real:
        """Norms over all rows."""
        return np.asarray(np.linalg.norm(half, axis=0))

    def matrices(self, count: int) -> Complex:
        """G of lines 0..count-1, shape (count, meshes, meshes)."""
        if len(self._matrices) < count:
            self._modal(count)
            self._matrices = np.asarray(self.meshes.T @ self._lines)
        return self._matrices[:count]

    @cached_property
    def _sizes(self) -> tuple[Real, Real, float]:
        """|G| and |n^2 w^2 H S| of lines up to `far`, what over n^2 bounds |G| beyond."""
        lines = self.far + 1
        sizes = np.linalg.norm(self.matrices(lines), 2, axis=(1, 2))
        moved = np.linalg.norm(self.shapes @ self._modal(lines), 2, axis=(1, 2))
        # from there on the real part of the dynamic stiffness is at least half of w^2 M
        beyond = 2 * float(np.linalg.norm(self.meshes, 2) / self.system.angular_frequency) ** 2
        return sizes, moved * self.weights(self.far), beyond

    def most_from(self, line: int) -> tuple[float, float]:
        """Bounds of |G| and of acceleration over x, of all lines from one on."""
        sizes, moved, beyond = self._sizes
        physical = 2 * float(np.linalg.norm(self.shapes, 2) * np.linalg.norm(self.meshes, 2))
        near, far = float(sizes[line:].max(initial=0.0)), beyond / max(line, self.far + 1) ** 2
        return max(near, far), max(float(moved[line:].max(initial=0.0)), physical)

    def quiet_above(self, level: float) -> int:
        """Line above which |G| <= level for certain."""
        sizes, _, beyond = self._sizes
        strong = np.flatnonzero(sizes > level)
        outer = math.ceil(math.sqrt(beyond / level))
        return outer if outer > self.far else int(strong[-1]) if len(strong) else 0

    def together(self, pattern: Pattern, right: Complex) -> Complex:
        """Solve all lines at once, by a dense matrix."""
        meshes, count = right.shape
        if meshes * (2 * count - 1) > MOST_UNKNOWNS:
            raise ArgumentError(
                f"harmonic balance of {count - 1} harmonics of {meshes} meshes takes more than "
                f"{MOST_UNKNOWNS} unknowns; use method='auto'"
            )
        weights = np.where(np.arange(count) == 0, 1.0, math.sqrt(2.0))
        scaled = right * weights
        rows = np.concatenate([scaled.real, scaled.imag[:, 1:]], axis=1)
        matrix = coupling_matrix(self.matrices(count), pattern.harmonics)
        found = np.linalg.solve(matrix, rows.ravel()).reshape(meshes, -1)
        x = found[:, :count].astype(complex)
        x[:, 1:] += 1j * found[:, count:]
        return np.asarray(x / weights)


def coupling_matrix(compliance: Complex, harmonics: Complex) -> Real:
    """Matrix of x -> x + phi G x in an orthonormal real basis of lines 0..N.

    Parameters
    ----------
    compliance : complex ndarray, shape (N+1, meshes, meshes)
        G.
    harmonics : complex ndarray, shape (meshes, J)
    """
    count, meshes = compliance.shape[:2]
    weights = np.where(np.arange(count) == 0, 1.0, math.sqrt(2.0))
    kept = with_zero_mean(np.atleast_2d(harmonics), 2 * (count - 1))
    values = samples(kept, fast_length(2 * count + kept.shape[1]))
    unit = np.concatenate([np.eye(count), 1j * np.eye(count)[1:]]) / weights
    columns = []
    for mesh in range(meshes):
        u = unit[:, None, :] * compliance[:, :, mesh].T
        product = np.fft.irfft(u, values.shape[-1], norm="forward") * values
        image = np.fft.rfft(product, norm="forward")[..., :count]
        image[:, mesh] += unit
        columns.append(image * weights)
    stacked = np.concatenate(columns)
    real = np.concatenate([stacked.real, stacked.imag[..., 1:]], axis=-1)
    return np.asarray(real.reshape(len(real), -1).T)


def inverse_norm(compliance: PairCompliance | SystemCompliance, pattern: Pattern) -> float:
    """Bound of |(1 + phi G)^-1|, infinite if none could be computed.

    With lines split at a core,

        1 + phi G = [ B_cc  phi G_t ; phi G_edge  1 + phi G_t ],

    the least singular value of B_cc is bounded, |phi G_t| < 1 gives that of the rest, and both
    together bound the whole.
    """
    swing, c = pattern.highest, np.atleast_2d(pattern.harmonics)
    most = swing * compliance.most_from(0)[0]
    if most < 0.5:
        return 1 / (1 - most)
    core, best = compliance.quiet_above(0.25 / swing) + c.shape[1] // 2 + 1, math.inf
    while 32 * c.size * len(c) * (2 * core + 1) <= BYTES_OF_BANDS:
        found, loop = _norm_from_core(compliance, swing, c, core)
        best = min(best, found)
        if loop <= 0.5 or math.isinf(loop):
            break
        # the loop falls with the fourth power of the core
        core = math.ceil(core * max(1.4, loop**0.25)) + 1
    return best


def _norm_from_core(
    compliance: PairCompliance | SystemCompliance, swing: float, c: Complex, core: int
) -> tuple[float, float]:
    """Bound from lines up to `core`, and the loop through the others, bounded below 1."""
    tail = swing * compliance.most_from(core + 1)[0]
    edge = swing * compliance.most_from(max(0, core + 1 - c.shape[1]))[0]
    inner = core_norm(compliance.matrices(core + 1), c)
    rest = 1 / (1 - tail)
    loop = inner * tail * rest * edge
    if loop > 0.98:
        return math.inf, loop
    coupled = np.array([[inner, inner * tail * rest], [rest * edge * inner, 0.0]]) / (1 - loop)
    coupled[1, 1] = rest + rest * edge * coupled[0, 1]
    return float(np.linalg.norm(coupled, 2)), loop


def core_norm(matrices: Complex, c: Complex) -> float:
    """Bound of |B^-1|, B the lines -N..N of 1 + phi G; infinite where rounding hides it.

    Parameters
    ----------
    matrices : complex ndarray, shape (N+1, meshes, meshes)
        G.
    c : complex ndarray, shape (meshes, J)

    Notes
    -----
    B^H B - s^2 has a Cholesky factor only if 1/s is such a bound. Inverse iteration finds s, and
    rounding of product and factor, below 8 (width + 1) units of the trace, is taken off
    (Higham, Accuracy and Stability of Numerical Algorithms, 2002, theorem 10.3).
    """
    bands = _normal_bands(matrices, c)
    rounding = 8 * (len(bands) + 1) * UNIT_ROUNDOFF * float(bands[0].real.sum())
    # of all directions something
    vector: Complex = np.exp(1j * np.arange(bands.shape[1]) ** 2)
    with suppress(np.linalg.LinAlgError):
        factor = scipy.linalg.cholesky_banded(bands, lower=True, check_finite=False)
        for _ in range(ITERATIONS):
            vector /= np.linalg.norm(vector)
            vector = scipy.linalg.cho_solve_banded((factor, True), vector).astype(complex)
        for square in np.array([0.8, 0.4, 0.1]) / np.linalg.norm(vector):
            shifted = bands.copy()
            shifted[0] -= square + rounding
            with suppress(np.linalg.LinAlgError):
                scipy.linalg.cholesky_banded(
                    shifted, overwrite_ab=True, lower=True, check_finite=False
                )
                return 1 / math.sqrt(square)
    return _norm_of_inverse(matrices, c)


def _norm_of_inverse(matrices: Complex, c: Complex) -> float:
    """Frobenius norm of B^-1, close where one direction outweighs all others."""
    if len(c) * (2 * len(matrices) - 1) > MOST_UNKNOWNS:
        return math.inf
    matrix = coupling_matrix(matrices, c)
    with suppress(np.linalg.LinAlgError):
        size = float(np.linalg.norm(np.linalg.inv(matrix)))
        rounding = size * float(np.linalg.norm(matrix)) * len(matrix) * UNIT_ROUNDOFF
        return size / (1 - rounding) if rounding < 0.5 else math.inf
    return math.inf


def _normal_bands(matrices: Complex, c: Complex) -> Complex:
    """Lower bands of B^H B, lines -N..N and in each of them the meshes."""
    meshes, reach = len(c), min(c.shape[1], 2 * len(matrices) - 2)
    c = c[:, :reach]
    swings = np.concatenate([c[:, ::-1].conj(), np.zeros((meshes, 1)), c], axis=1)
    both = np.concatenate([matrices[:0:-1].conj(), matrices])
    count = len(both)
    # what a line gives to those from `reach` below to `reach` above it
    blocks = swings.T[None, :, :, None] * both[:, None]
    blocks[:, reach] += np.eye(meshes)
    target = np.arange(count)[:, None] + np.arange(-reach, reach + 1)
    blocks[(target < 0) | (target >= count)] = 0
    bands = np.zeros(((2 * reach + 1) * meshes, count, meshes), dtype=complex)
    for apart in range(min(2 * reach, count - 1) + 1):
        one = blocks[: count - apart, apart:].reshape(count - apart, -1, meshes)
        other = blocks[apart:, : 2 * reach + 1 - apart].reshape(count - apart, -1, meshes)
        product = other.conj().transpose(0, 2, 1) @ one
        for row, column in np.ndindex(meshes, meshes):
            if apart or row >= column:
                place = apart * meshes + row - column
                bands[place, : count - apart, column] = product[:, row, column]
    return bands.reshape(len(bands), -1)
