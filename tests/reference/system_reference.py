"""Slow and obvious solutions of systems with several meshes, in physical coordinates."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import qr
from scipy.sparse import bmat
from scipy.sparse.linalg import splu

from gearmon.dynamics import HillSystem


def random_system(rng, most_coordinates=12, most_meshes=4, most_harmonics=5, variation=0.4):
    """A chain of masses on springs with meshes anywhere; some free, some gyroscopic."""
    n = int(rng.integers(3, most_coordinates + 1))
    meshes = int(rng.integers(2, most_meshes + 1))
    mass = np.diag(np.exp(rng.uniform(-1, 1, n)))
    links = np.concatenate([np.diff(np.eye(n), axis=0), rng.normal(size=(2, n))])
    stiffness = links.T @ (np.exp(rng.uniform(0, 2, len(links)))[:, None] * links)
    vectors = np.zeros((meshes, n))
    for vector in vectors:
        some = rng.choice(n, min(n, int(rng.integers(2, 5))), replace=False)
        vector[some] = rng.normal(size=len(some))
    gyroscopic = None
    if rng.random() < 0.3:
        turning = rng.normal(size=(n, n))
        gyroscopic = 0.1 * (turning - turning.T)
    if rng.random() < 0.3:
        # a motion that nothing holds
        free = qr(rng.normal(size=(n, 1)))[0][:, 0]
        apart = np.eye(n) - np.outer(free, free)
        stiffness, vectors = apart @ stiffness @ apart, vectors @ apart
        gyroscopic = None if gyroscopic is None else apart @ gyroscopic @ apart
    else:
        apart = np.eye(n)
    zeta = 10 ** rng.uniform(-2, -0.7)
    damping = apart @ (0.3 * zeta * mass) @ apart + 0.3 * zeta * stiffness
    if rng.random() < 0.5:
        rough = apart @ rng.normal(size=(n, 2))
        damping += zeta * rough @ rough.T
    count = int(rng.integers(1, most_harmonics + 1))
    c = rng.normal(size=(meshes, count)) + 1j * rng.normal(size=(meshes, count))
    c *= variation * rng.random((meshes, 1)) / (2 * np.abs(c).sum(axis=1, keepdims=True))
    means = np.exp(rng.uniform(0, 2, meshes))
    period = 2 * np.pi / np.exp(rng.uniform(-1.2, 1.2))
    return HillSystem(
        mass, damping, stiffness, vectors, means, c, period, apart @ rng.normal(size=n), gyroscopic
    )


def stiffness_at(system, time):
    """K with the meshes at a time, term by term."""
    orders = np.arange(1, system.mesh_harmonics.shape[1] + 1)
    turn = np.exp(2j * np.pi * orders * time / system.period_s)
    means = system.mesh_stiffness_n_per_m
    strength = means * (1 + 2 * (system.mesh_harmonics @ turn).real)
    return system.stiffness + system.mesh_vectors.T @ (strength[:, None] * system.mesh_vectors)


def velocity_matrix(system):
    """Damping and gyroscopic terms."""
    turning = 0 if system.gyroscopic is None else system.gyroscopic
    meshes = 0
    if system.mesh_damping_ns_per_m is not None:
        v = system.mesh_vectors
        meshes = v.T @ (system.mesh_damping_ns_per_m[:, None] * v)
    return system.damping + turning + meshes


def periodic_motion(system, count):
    """q'' at equal steps of a period and the period's map, by shooting in time."""
    n, inverse, velocity = len(system.mass), np.linalg.inv(system.mass), velocity_matrix(system)

    def slope(time, flat):
        x = flat.reshape(2 * n, -1)
        force = -velocity @ x[n:] - stiffness_at(system, time) @ x[:n]
        force[:, -1] += system.force_n
        return np.concatenate([x[n:], inverse @ force]).ravel()

    start = np.concatenate([np.eye(2 * n), np.zeros((2 * n, 1))], axis=1)
    times = system.period_s * np.arange(count + 1) / count
    found = solve_ivp(
        slope, (0, system.period_s), start.ravel(), "DOP853", times, rtol=1e-11, atol=1e-12
    ).y.T.reshape(count + 1, 2 * n, 2 * n + 1)
    whole, moved = found[-1, :, :-1], found[-1, :, -1]
    # a free motion keeps its place and speed: any will do, its acceleration is none
    state = np.linalg.lstsq(np.eye(2 * n) - whole, moved, rcond=1e-9)[0]
    states = found[:-1, :, :-1] @ state + found[:-1, :, -1]
    rates = [
        slope(t, np.append(x[:, None], x[:, None], axis=1).ravel()).reshape(2 * n, 2)[n:, -1]
        for t, x in zip(times, states, strict=False)
    ]
    return np.array(rates), whole


def lines_at_once(system, highest):
    """q_0..q_highest from one sparse matrix over all coordinates and lines."""
    n, lines = len(system.mass), range(-highest, highest + 1)
    w, velocity, mean = 2 * np.pi / system.period_s, velocity_matrix(system), stiffness_mean(system)
    v, means = system.mesh_vectors, system.mesh_stiffness_n_per_m
    # what nothing holds stays where it is in the mean
    _, sizes, shapes = np.linalg.svd(mean)
    free = shapes[sizes < 1e-10 * sizes[0]]
    blocks = [[None] * len(lines) for _ in lines]
    for row, line in enumerate(lines):
        # rows of one size, and a step of refinement, leave little to rounding
        scale = 1 / (1 + (line * w) ** 2)
        dynamic = mean - (line * w) ** 2 * system.mass + 1j * line * w * velocity
        blocks[row][row] = scale * (dynamic + (free.T @ free if line == 0 else 0))
        for j, c in enumerate(system.mesh_harmonics.T, start=1):
            part = scale * (v.T @ ((means * c)[:, None] * v))
            if row >= j:
                blocks[row][row - j] = part
            if row + j < len(lines):
                blocks[row][row + j] = part.conj()
    matrix = bmat(blocks, format="csc")
    right = np.zeros((len(lines), n), dtype=complex)
    right[highest] = system.force_n
    right = right.ravel()
    solve = splu(matrix).solve
    found = solve(right)
    found += solve(right - matrix @ found)
    return found.reshape(len(lines), n)[highest:]


def relative(lines, response):
    """Relative L2 error of the acceleration of all coordinates."""
    count = max(len(lines), len(response.displacement))
    both = np.zeros((2, count, lines.shape[1]), dtype=complex)
    both[0, : len(lines)], both[1, : len(response.displacement)] = lines, response.displacement
    both *= (np.arange(count) ** 2)[:, None]
    return np.linalg.norm(both[0] - both[1]) / np.linalg.norm(both[0])


def stiffness_mean(system):
    v = system.mesh_vectors
    return system.stiffness + v.T @ (system.mesh_stiffness_n_per_m[:, None] * v)
