"""Steady vibration of a `HillSystem`: its meshes are the unknowns, its machine a compliance.

A mesh feels the rest of the machine only through the dynamic compliance of the machine with mean
stiffnesses. With u_j = sqrt(k_j) d_j, the swing of the mesh forces x_j = -phi_j u_j and

    G(n w) = S^T [K_mean - (n w)^2 M + i n w (C + G)]^-1 S,    S = columns sqrt(k_j) v_j,

the lines obey u_n = S^T q0_n + G(n w) x_n, x = -phi u: unknowns are meshes x lines, whatever the
machine. A single pair is the case where G is the number 1/D_n. The orders of multiple scales are
x^(0) = -phi S^T q0, x^(k+1) = -phi G x^(k); they are summed, or recombined by least residual
(`LeastResidual`), or all lines are solved together.

Bound. An approximation x of lines 0..N is followed by one more order x' = -phi u, which leaves the
residual s = -phi G (x' - x), all of it known. With B = 1 + phi G and its lines split at a core,

    B = [ B_cc  phi G_t ; phi G_edge  1 + phi G_t ],

the inverse of B_cc is computed and measured, |phi G_t| < 1 gives that of the rest, and both bound
|B^-1| (`inverse_norm`). Beyond about twice the highest natural frequency w_h, where no line is
computed, |G| <= |S^T M^-1 S|/(w^2 - w_h^2 - w g) with g the size of the gyroscopic terms, because
the real part of the dynamic stiffness is no smaller. The acceleration of all coordinates then errs
by at most max_n |(n w)^2 H_n S| |B^-1| |s|.

Stability is settled by the eigenvalues of the map over a period: free vibrations of the mean
machine in closed form between kicks by the meshes, steps halved and extrapolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics.fourier import (
    Complex,
    Modulation,
    Real,
    fast_length,
    rms,
    samples,
    supremum,
    with_zero_mean,
)
from gearmon.dynamics.least_residual import LeastResidual
from gearmon.dynamics.system import HillSystem, SystemResponse
from gearmon.errors import ArgumentError

UNIT_ROUNDOFF = 2.0**-52
MOST_ORDERS, MOST_ROUNDS = 400, 8
#: Unknowns of a matrix that is inverted or solved: 3000 take 70 MB and some seconds.
MOST_UNKNOWNS = 3000
#: Lines of the compliance that are computed at most.
MOST_LINES = 20_000
#: Steps of the period map at most, and change of the largest multiplier that is small.
MOST_STEPS, SETTLED = 1 << 15, 1e-9


class Compliance:
    """Dynamic compliance of a machine with mean stiffnesses, line by line.

    Parameters
    ----------
    system : HillSystem
    """

    def __init__(self, system: HillSystem) -> None:
        self.system = system
        self.squares, self.shapes = system.modes
        self.squares = np.where(system.rigid, 0.0, self.squares)
        self.damping = self.shapes.T @ system.velocity_matrix @ self.shapes
        scale = np.sqrt(system.mesh_stiffness_n_per_m)
        #: mesh vectors in modal coordinates times sqrt(k_j), shape (n, meshes)
        self.meshes = self.shapes.T @ (system.mesh_vectors * scale[:, None]).T
        self._lines: Complex = np.zeros((0, *self.meshes.shape), dtype=complex)

    @cached_property
    def far(self) -> int:
        """Line from which on the bounds for high frequencies hold and are within a factor of 2."""
        skew = (self.damping - self.damping.T) / 2
        turning = float(np.linalg.norm(skew, 2)) if self.system.gyroscopic is not None else 0.0
        top = turning + math.sqrt(turning**2 + 2 * float(self.squares[-1]))
        return math.ceil(top / self.system.angular_frequency) + 1

    def modal(self, count: int) -> Complex:
        """Modal answers to unit mesh forces over sqrt(k_j), shape (count, n, meshes)."""
        known = len(self._lines)
        if count > known:
            more = max(count, 2 * known) if known else count
            new = [self._answers(np.arange(known, more, dtype=float), self.meshes[None])]
            self._lines = np.concatenate([self._lines, *new])
        return self._lines[:count]

    def _answers(self, lines: Real, forces: Complex | Real) -> Complex:
        """Modal answers to modal forces, shape (lines, n, ...)."""
        w = self.system.angular_frequency * lines[:, None]
        diagonal = self.squares - w**2 + 0j
        if lines[0] == 0:
            # a rigid-body motion has no mean
            diagonal[0, self.system.rigid] = np.inf
        if _is_diagonal(self.damping):
            diagonal += 1j * w * np.diag(self.damping)
            return np.asarray(forces / diagonal[..., None])
        matrix = 1j * w[:, :, None] * self.damping
        where = np.arange(len(self.squares))
        finite = np.where(np.isinf(diagonal), 1.0, diagonal)
        matrix[:, where, where] += finite
        stacked = np.broadcast_to(forces, (len(lines), *np.shape(forces)[1:]))
        found = np.linalg.solve(matrix, stacked)
        found[np.isinf(diagonal)] = 0
        return np.asarray(found)

    def forced(self) -> Complex:
        """Modal answers to the forces alone, lines 0.., shape (lines, n)."""
        f = self.system.force_harmonics_n
        forces = self.system.force_n[None].astype(complex)
        if f is not None:
            forces = np.concatenate([forces, f])
        return self._answers(
            np.arange(len(forces), dtype=float), (forces @ self.shapes)[..., None]
        )[..., 0]

    def at_meshes(self, count: int) -> Complex:
        """G of lines 0..count-1, shape (count, meshes, meshes)."""
        return np.asarray(self.meshes.T @ self.modal(count))

    @cached_property
    def gains(self) -> tuple[Real, float, float]:
        """Values of |G| up to `far`, what over n^2 bounds it beyond, and max |n^2 w^2 H S|."""
        lines = self.far + 1
        sizes = np.linalg.norm(self.at_meshes(lines), 2, axis=(1, 2))
        w = self.system.angular_frequency
        # from there on the real part of the dynamic stiffness is at least half of w^2 M
        beyond = 2 * float(np.linalg.norm(self.meshes, 2)) ** 2 / w**2
        moved = self.shapes @ self.modal(lines)
        weights = (w * np.arange(lines)) ** 2
        largest = float((np.linalg.norm(moved, 2, axis=(1, 2)) * weights).max())
        physical = float(np.linalg.norm(self.shapes, 2) * np.linalg.norm(self.meshes, 2))
        return sizes, beyond, max(largest, 2 * physical)

    def most_from(self, line: int) -> float:
        """Bound of |G| of all lines from one on."""
        sizes, beyond, _ = self.gains
        near = float(sizes[line:].max(initial=0.0))
        return max(near, beyond / max(line, self.far + 1) ** 2)


def _is_diagonal(matrix: Real) -> bool:
    off = matrix - np.diag(np.diag(matrix))
    return bool(np.abs(off).max() <= 1e-12 * np.abs(matrix).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Answer:
    """Mesh force swings x over sqrt(k_j), the bound of their error and what it relates to."""

    swings: Complex
    displacement: Complex
    relative: float
    above: bool
    orders: int


class Meshes:
    """The equations of the meshes of one system.

    Parameters
    ----------
    system : HillSystem
    shown : int, optional
        Highest harmonic that is handed out; default all.
    """

    def __init__(self, system: HillSystem, shown: int | None) -> None:
        self.system, self.shown = system, shown
        self.compliance = Compliance(system)
        if self.compliance.far > MOST_LINES:
            raise ArgumentError(
                f"period_s={system.period_s} s: the highest natural frequency "
                f"{system.natural_frequencies_hz[-1]:.4g} Hz lies more than {MOST_LINES // 2} "
                "lines up; leave out what is so stiff, or take a shorter period"
            )
        self.c = system.mesh_harmonics
        #: bound of max|phi_j| of any mesh
        self.swing = max((supremum(with_zero_mean(c)) for c in self.c), default=0.0)
        self.forced = self.compliance.forced()
        #: S^T q0, lines 0.., shape (meshes, lines)
        self.start = self.compliance.meshes.T @ self.forced.T

    def first_highest(self, tolerance: float) -> int:
        """Guess the number of lines: each jump by the bandwidth of phi costs max|phi| |G|."""
        total = np.abs(self.c).sum(axis=0)
        given = max(2, int(self.start.shape[1]), self.shown or 1)
        if not total.any():
            return given
        sizes = self.swing * self.compliance.gains[0]
        strong = np.flatnonzero(sizes > 0.5)
        top = max(given, int(self.c.shape[1]), int(strong[-1]) if len(strong) else 0)
        jump = max(1, round(float(np.arange(1, len(total) + 1) @ total / total.sum())))
        share = 1.0
        while share > 1e-3 * tolerance and top < MOST_LINES:
            top += jump
            share *= min(0.8, self.swing * self.compliance.most_from(top))
        return top

    def phi(self, half: Complex, outputs: int) -> Complex:
        """Lines 0..outputs of phi_j u_j, shape (meshes, ...)."""
        mean = half[:, :1].real
        swinging = half.copy()
        swinging[:, 0] = 0
        product = Modulation(self.c, half.shape[1] - 1, outputs)(swinging)
        # phi times the large mean is known without a transform and its rounding
        kept = min(self.c.shape[1], outputs)
        product[:, 1 : kept + 1] += mean * self.c[:, :kept]
        return product

    def answer(self, x: Complex) -> Complex:
        """G x, shape (meshes, N+1)."""
        compliance = self.compliance.at_meshes(x.shape[1])
        return np.asarray((compliance @ x.T[:, :, None])[:, :, 0].T)

    def deflections(self, x: Complex) -> Complex:
        """Mesh deflections S^T q0 + G x, shape (meshes, N+1)."""
        u = self.answer(x)
        count = min(u.shape[1], self.start.shape[1])
        u[:, :count] += self.start[:, :count]
        u[:, 0] = u[:, 0].real
        return u

    def displacement(self, x: Complex) -> Complex:
        """All coordinates, shape (N+1, n)."""
        q = np.einsum("lnm,ml->ln", self.compliance.modal(x.shape[1]), x)
        count = min(len(q), len(self.forced))
        q[:count] += self.forced[:count]
        moved: Complex = q @ self.compliance.shapes.T
        moved[0] = moved[0].real
        return moved

    def size(self, displacement: Complex) -> float:
        """Rms acceleration of what is handed out, all coordinates together [m/s2]."""
        last = len(displacement) if self.shown is None else self.shown + 1
        weights = (self.system.angular_frequency * np.arange(len(displacement))) ** 2
        return _size((weights[:last, None] * displacement[:last]).T)

    def matrix(self, highest: int) -> Real:
        """B of lines 0..highest as a real matrix of an orthonormal basis."""
        meshes, count = len(self.c), highest + 1
        weights = np.where(np.arange(count) == 0, 1.0, math.sqrt(2.0))
        values = samples(with_zero_mean(self.c, 2 * highest), _length(self.c, highest))
        compliance = self.compliance.at_meshes(count)
        columns = []
        for mesh in range(meshes):
            unit = np.zeros((2 * count, count), dtype=complex)
            unit[np.arange(count), np.arange(count)] = 1
            unit[count + np.arange(count), np.arange(count)] = 1j
            unit = np.delete(unit, count, axis=0) / weights
            u = unit[:, None, :] * compliance[:, :, mesh].T
            product = np.fft.irfft(u, values.shape[-1], norm="forward") * values
            image = np.fft.rfft(product, norm="forward")[..., :count]
            image[:, mesh] += unit
            columns.append(image * weights)
        stacked = np.concatenate(columns)
        real = np.concatenate([stacked.real, stacked.imag[..., 1:]], axis=-1)
        return np.asarray(real.reshape(len(real), -1).T)

    @cached_property
    def inverse_norm(self) -> float:
        """Bound of |B^-1|, infinite if none could be computed."""
        if not self.swing:
            return 1.0
        most = self.swing * self.compliance.most_from(0)
        if most < 0.5:
            return 1 / (1 - most)
        sizes = self.swing * self.compliance.gains[0]
        strong = np.flatnonzero(sizes > 0.25)
        core = (int(strong[-1]) if len(strong) else 0) + self.c.shape[1] // 2 + 1
        while len(self.c) * (2 * core + 1) <= MOST_UNKNOWNS:
            found = self._norm_from_core(core)
            if found is not None:
                return found
            core = math.ceil(1.4 * core) + 1
        return math.inf

    def _norm_from_core(self, core: int) -> float | None:
        """Bound with lines up to `core` inverted, or None if the others are too strong."""
        tail = self.swing * self.compliance.most_from(core + 1)
        if tail >= 0.5:
            return None
        edge = self.swing * self.compliance.most_from(max(0, core + 1 - self.c.shape[1]))
        matrix = self.matrix(core)
        try:
            inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        inner = _crude_norm(inverse)
        rounding = inner * _crude_norm(matrix) * len(matrix) * UNIT_ROUNDOFF
        rest = 1 / (1 - tail)
        loop = inner * tail * rest * edge
        if rounding > 0.5 or loop > 0.5:
            return None
        inner /= 1 - rounding
        coupled = np.array([[inner, inner * tail * rest], [rest * edge * inner, 0.0]]) / (1 - loop)
        coupled[1, 1] = rest + rest * edge * coupled[0, 1]
        return float(np.linalg.norm(coupled, 2))

    def judge(self, x: Complex, orders: int) -> _Answer:
        """Follow x by one more order, and bound the error of what it gives."""
        highest, band = x.shape[1] - 1, self.c.shape[1]
        u = self.deflections(x)
        better = -self.phi(u, highest + band)
        step = better.copy()
        step[:, : highest + 1] -= x
        change = self.answer(step)
        left = _size(self.phi(change, highest + 2 * band))
        depth = 8 + math.log2(8 * (highest + 2 * band + 1)) + len(self.compliance.squares)
        swinging = u.copy()
        swinging[:, 0] = 0
        # the share of the mean deflections is not summed, and rounds but once
        noise = 2 * _size(better) + depth * self.swing * _size(swinging)
        displacement = self.displacement(better)
        size = self.size(displacement)
        gain = self.compliance.gains[2] * self.inverse_norm
        error = gain * (left + UNIT_ROUNDOFF * noise) if left or noise else 0.0
        beyond = _size(change[:, highest + 1 :]) if highest + 1 < change.shape[1] else 0.0
        return _Answer(
            swings=better,
            displacement=displacement,
            relative=error / (size - error) if error < size else (math.inf if error else 0.0),
            above=beyond > 0.5 * _size(change),
            orders=orders,
        )

    def solve(self, method: str, tolerance: float, order: int | None) -> _Answer:
        """Meet a tolerance, or come as near as can be."""
        highest, sharper = self.first_highest(tolerance), 1.0
        best = self._once(method, highest, tolerance, order)
        for _ in range(MOST_ROUNDS):
            if best.relative <= tolerance or order is not None or math.isinf(self.inverse_norm):
                break
            if best.above:
                highest += max(4, highest // 3)
            else:
                sharper *= min(0.3, max(1e-4, 0.3 * tolerance / best.relative))
            found = self._once(method, highest, sharper * tolerance, None)
            if found.relative > 0.9 * best.relative and not (
                best.above or math.isinf(best.relative)
            ):
                break
            best = found
        return best

    def _once(self, method: str, highest: int, tolerance: float, order: int | None) -> _Answer:
        start = np.zeros((len(self.c), highest + 1), dtype=complex)
        right = -self.phi(self.deflections(start), highest)
        if method == "harmonic balance":
            return self.judge(self._together(right), 0)
        # what is left goes once more through phi G before it is judged
        sizes, _, largest = self.compliance.gains
        gain = largest * min(self.inverse_norm, 1e6) * max(1.0, self.swing * float(sizes.max()))
        target = 0.3 * tolerance * self.size(self.displacement(right)) / gain
        most = MOST_ORDERS if order is None else order - 1
        if most < 1 or not right.any():
            return self.judge(start, 1)
        if method == "msm":
            return self._plain(right, target, most, order is not None)
        space = LeastResidual(lambda x: self.phi(self.answer(x), highest), right, most)
        space.extend(target if order is None else 0.0)
        return self.judge(space.solution(), space.orders + 1)

    def _plain(self, right: Complex, target: float, most: int, fixed: bool) -> _Answer:
        """Sum the orders as they come."""
        term, total, orders = right, right.copy(), 1
        while orders < most and (fixed or target < _size(term) < 1e3 * _size(right)):
            term = -self.phi(self.answer(term), right.shape[1] - 1)
            total += term
            orders += 1
        return self.judge(total, orders + 1)

    def _together(self, right: Complex) -> Complex:
        """All lines at once, by the matrix."""
        meshes, count = right.shape
        if meshes * (2 * count - 1) > MOST_UNKNOWNS:
            raise ArgumentError(
                f"harmonic balance of {count - 1} harmonics of {meshes} meshes takes more than "
                f"{MOST_UNKNOWNS} unknowns; use method='auto'"
            )
        weights = np.where(np.arange(count) == 0, 1.0, math.sqrt(2.0))
        scaled = right * weights
        rows = np.concatenate([scaled.real, scaled.imag[:, 1:]], axis=1)
        found = np.linalg.solve(self.matrix(count - 1), rows.ravel()).reshape(meshes, -1)
        x = found[:, :count].astype(complex)
        x[:, 1:] += 1j * found[:, count:]
        return np.asarray(x / weights)

    @cached_property
    def multipliers(self) -> Complex:
        """Floquet multipliers, the largest modulus first."""
        count = 1 << math.ceil(math.log2(max(32, 4 * self.c.shape[1], 2 * self._radians)))
        rows = [[self._period_map(count)]]
        old = math.nan
        while True:
            count *= 2
            row = [self._period_map(count)]
            # errors of a symmetric step are even powers of it
            for k, before in enumerate(rows[-1][:3], start=1):
                row.append(row[-1] + (row[-1] - before) / (4**k - 1))
            rows.append(row)
            values = np.linalg.eigvals(row[-1])
            radius = float(np.abs(values).max(initial=0.0))
            if abs(radius - old) <= max(SETTLED, 1e-3 * abs(1 - radius)) or count >= MOST_STEPS:
                return np.asarray(values[np.argsort(-np.abs(values))], dtype=complex)
            old = radius

    @property
    def _radians(self) -> float:
        """Angle by which the fastest vibration that a mesh feels turns over a period."""
        felt = np.linalg.norm(self.compliance.meshes, axis=1) > 1e-6 * np.linalg.norm(
            self.compliance.meshes
        )
        fastest = math.sqrt(float(self.compliance.squares[felt].max(initial=0.0)))
        return fastest * self.system.period_s

    def _period_map(self, count: int) -> Real:
        """Map of the modal state over a period in `count` steps, free rigid motions left out."""
        from scipy.linalg import expm

        compliance, step = self.compliance, self.system.period_s / count
        # nothing depends on the place of a rigid-body motion, and on its speed only if it is damped
        sizes = np.abs(compliance.damping)
        held = ~self.system.rigid
        kept = held | (sizes.max(axis=1) > 1e-12 * sizes.max())
        squares, damping = compliance.squares[kept], compliance.damping[np.ix_(kept, kept)]
        meshes, n = compliance.meshes[kept], int(kept.sum())
        # velocities over w0, so that all entries are of one size
        scale = math.sqrt(float(squares.max(initial=1.0)))
        rate = np.block(
            [[np.zeros((n, n)), scale * np.eye(n)], [-np.diag(squares) / scale, -damping]]
        )
        drift = expm(rate * step)
        values = samples(with_zero_mean(self.c), count) if count > 2 * self.c.shape[1] else None
        if values is None:
            raise ArgumentError(f"mesh_harmonics: more than {MOST_STEPS // 2} of them")
        state, kick = np.eye(2 * n), step / scale
        half = 0.5 * kick * values[:, 0]
        state[n:] -= meshes @ (half[:, None] * (meshes.T @ state[:n]))
        for i in range(1, count + 1):
            state = drift @ state
            share = kick if i < count else 0.5 * kick
            strength = share * values[:, i % count]
            state[n:] -= meshes @ (strength[:, None] * (meshes.T @ state[:n]))
        matters = np.concatenate([held[kept], np.ones(n, dtype=bool)])
        return np.asarray(state[np.ix_(matters, matters)])


def _length(c: Complex, highest: int) -> int:
    kept = min(c.shape[1], 2 * highest)
    return fast_length(2 * highest + kept + 1)


def _size(half: Complex) -> float:
    """Root of the sum of the mean squares of several functions, shape (functions, N+1)."""
    return math.sqrt(sum(rms(row) ** 2 for row in half))


def _crude_norm(matrix: Real) -> float:
    """Bound of the spectral norm that needs no singular values."""
    sizes = np.abs(matrix)
    return math.sqrt(float(sizes.sum(axis=0).max()) * float(sizes.sum(axis=1).max()))


def solve_system(
    system: HillSystem,
    tolerance: float,
    method: str,
    order: int | None,
    harmonics: int | None,
) -> SystemResponse:
    """Steady vibration of a system; arguments and errors as of `steady_state`, checked there."""
    meshes = Meshes(system, harmonics)
    way = "msm least residual" if method == "auto" else method
    found = meshes.solve(way, tolerance, order)
    radius = float(np.abs(meshes.multipliers[:1]).max(initial=0.0))
    stable = radius < 1 - SETTLED
    bound = found.relative if stable else math.inf
    scale = np.sqrt(system.mesh_stiffness_n_per_m)
    u = meshes.deflections(found.swings)
    force = scale[:, None] * (u - found.swings)
    if system.mesh_damping_ns_per_m is not None:
        rates = 1j * system.angular_frequency * np.arange(u.shape[1]) * u
        force += (system.mesh_damping_ns_per_m / scale)[:, None] * rates
    last = len(found.displacement) if harmonics is None else harmonics + 1
    displacement, mesh_force = _cut(found.displacement, last), _cut(force.T, last)
    if not stable:
        message = (
            f"unstable: free vibrations change by {radius:.6g} a period (largest Floquet "
            "multiplier), so there is no steady state"
        )
    else:
        verdict = "meets" if bound <= tolerance else "misses"
        message = (
            f"{way}, {found.orders} orders, {len(meshes.c)} meshes, harmonics 0 to "
            f"{len(found.displacement) - 1}: error bound {bound:.2g} {verdict} the tolerance "
            f"{tolerance:.2g}"
        )
    return SystemResponse(
        system=system,
        displacement=displacement,
        mesh_force=mesh_force,
        error_bound=bound,
        method=way,
        order=found.orders,
        floquet_multipliers=meshes.multipliers,
        stable=stable,
        message=message,
    )


def _cut(half: Complex, count: int) -> Complex:
    """Lines 0..count-1, zeros where there are none."""
    cut = np.zeros((count, half.shape[1]), dtype=complex)
    cut[: min(count, len(half))] = half[:count]
    return cut
