"""Sideband families of one shaft, and all sizes of its fault from one basis.

Under the even stiffness phi_0, which repeats with the mesh, the lines nP + r of a shaft turn of P
meshes split into families r that know nothing of each other: L_0 is inverted family by family. A
fault delta couples them. Its answer b to the vibration z_0 of the even mesh,

    (L_0 + f delta) b = -f delta z_0
    b = L_0^{-1} u,      (1 + f delta L_0^{-1}) u = -f delta z_0

is sought among the orders of its series in delta, u, delta L_0^{-1} u, ..., recombined by least
residual (GMRES): the space is the same for every size f, so that all sizes cost one basis. A
damaged tooth is delta on two of P meshes, and the orders are few because little happens there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Modulation, Real
from gearmon.errors import ArgumentError

BYTES_ALLOWED = 1e9
MOST_ORDERS = 80


def dynamic_stiffness(ratio: float, zeta: float, lines: npt.NDArray[np.int_]) -> Complex:
    """D = 1 - (n/R)^2 + 2 i zeta n/R of any lines n, relative to the mean stiffness."""
    x = lines / ratio
    return np.asarray((1 - x**2) + 2j * zeta * x)


class Families:
    """Inverse of L_0 on the harmonics of a shaft turn, family by family.

    Parameters
    ----------
    ratio, zeta : float
        w0 over the angular frequency of the shaft, damping ratio.
    even : complex ndarray, shape (J,)
        Harmonics of phi_0 over the mesh period.
    meshes : int
        P.
    highest : int
        N, highest mesh harmonic.

    Raises
    ------
    ArgumentError
        If the matrices would not fit in memory.
    """

    def __init__(self, ratio: float, zeta: float, even: Complex, meshes: int, highest: int) -> None:
        self.meshes, self.highest = meshes, highest
        self.top = highest * meshes + meshes // 2
        # two-sided lines nP + r, r = 0..P/2; the other families are their conjugates
        offsets = np.arange(meshes // 2 + 1)
        self.lines = meshes * np.arange(-highest, highest + 1) + offsets[:, None]
        count, size = self.lines.shape
        if 16 * count * size**2 > BYTES_ALLOWED:
            raise ArgumentError(
                f"{count} sideband families of {size} lines need "
                f"{16 * count * size**2 / 1e9:.1f} GB; use steady_state with method='auto'"
            )
        row = np.zeros(2 * size - 1, dtype=complex)
        kept = even[: size - 1]
        row[size : size + len(kept)] = kept
        row[size - 1 - len(kept) : size - 1] = kept[::-1].conj()
        coupling = np.lib.stride_tricks.sliding_window_view(row, size)[:, ::-1]
        matrices = np.broadcast_to(coupling, (count, size, size)).copy()
        diagonal = np.arange(size)
        matrices[:, diagonal, diagonal] += dynamic_stiffness(ratio, zeta, self.lines)
        self.inverse: Complex = np.linalg.inv(matrices)
        self._below = self.lines < 0
        self._places = np.abs(self.lines)

    def solve(self, half: Complex) -> Complex:
        """L_0^{-1} of a half spectrum 0..NP + P/2."""
        right = half[self._places]
        np.conjugate(right, out=right, where=self._below)
        found = (self.inverse @ right[:, :, None])[:, :, 0]
        np.conjugate(found, out=found, where=self._below)
        answer = np.zeros(self.top + 1, dtype=complex)
        answer[self._places] = found
        answer[0] = answer[0].real
        return answer


@dataclass(frozen=True, kw_only=True)
class Answers:
    """Answers b to one fault at several sizes.

    Attributes
    ----------
    factors : float ndarray, shape (S,)
        Sizes f.
    lines : complex ndarray, shape (S, NP + P//2 + 1)
        b [m per m of static deflection, as z_0].
    orders : int
        Orders of the series in the basis.
    """

    factors: Real
    lines: Complex
    orders: int


def answers(
    families: Families, delta: Complex, carrier: Complex, factors: Real, tolerance: float
) -> Answers:
    """Answers to f delta for all sizes f, to a relative residual.

    Parameters
    ----------
    families : Families
        L_0^{-1}.
    delta : complex ndarray, shape (K,)
        Harmonics of the fault over the shaft turn.
    carrier : complex ndarray, shape (NP + 1,)
        z_0 on the lines of the shaft turn.
    factors : float ndarray, shape (S,)
        Sizes.
    tolerance : float
        Rms residual to reach, relative to that of f delta z_0.
    """
    top = families.top
    modulate = Modulation(delta, top, top)
    start = -Modulation(delta, len(carrier) - 1, top)(carrier)
    # scaled so that the dot product of real views is the mean product over the period
    weights = np.full(top + 1, math.sqrt(2.0))
    weights[0] = 1.0
    first = (weights * start).view(float)
    length = float(np.linalg.norm(first))
    if length == 0:
        return Answers(
            factors=factors, lines=np.zeros((len(factors), top + 1), dtype=complex), orders=0
        )
    basis, solved = [first / length], list[Complex]()
    hessenberg = np.zeros((MOST_ORDERS + 1, MOST_ORDERS))
    for order in range(1, MOST_ORDERS + 1):
        inner = families.solve(basis[-1].view(complex) / weights)
        solved.append(inner)
        image = (weights * modulate(inner)).view(float)
        for _ in range(2):
            known = np.array(basis)
            shares = known @ image
            image = image - shares @ known
            hessenberg[:order, order - 1] += shares
        size = float(np.linalg.norm(image))
        hessenberg[order, order - 1] = size
        recombined = [_recombine(hessenberg, order, f) for f in factors]
        largest = max(left for _, left in recombined)
        if largest <= tolerance or size <= 1e-14 * np.abs(hessenberg[:, order - 1]).max():
            break
        basis.append(image / size)
    combined: Real = np.array([f * y for f, (y, _) in zip(factors, recombined, strict=True)])
    lines: Complex = length * np.einsum("sk,kn->sn", combined, np.array(solved))
    return Answers(factors=factors, lines=lines, orders=order)


def _recombine(hessenberg: Real, order: int, factor: float) -> tuple[Real, float]:
    """Least-residual shares of the basis for one size, and the relative residual left."""
    matrix = factor * hessenberg[: order + 1, :order]
    matrix[:order] += np.eye(order)
    right = np.zeros(order + 1)
    right[0] = 1.0
    shares: Real = np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)
    return shares, float(np.linalg.norm(matrix @ shares - right))
