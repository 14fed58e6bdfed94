"""Stability of the periodic vibration: charts, margins, and boundaries of the unstable tongues.

Free vibrations of m z'' + c z' + k0 [1 + eps f(t)] z = 0 are multiplied by the Floquet multipliers
from period to period; their product is e^{-4 pi R zeta}, so only a real multiplier can leave the
unit circle: through +1 (the growing vibration has the period of the mesh) or through -1 (it has
twice that period).

The n-th unstable tongue starts from w/w0 = 2/n. On its boundaries a vibration of period T (n even)
or 2T (n odd) neither grows nor dies out. Undamped, with y = sum_m y_m e^{i m w t} and integer or
half-odd m, these are the eigenvalues of a Hermitian problem,

    (w/w0)^2 m^2 y_m = y_m + eps sum_j f_{m-j} y_j,

two for each tongue, and they come to nearly machine precision. The damped tongue is found inside
the undamped one of w0^2 - h^2, whose growth e^{h t} outdoes there.

By multiple scales. The amplitude equation of line p = n/2 (see `parametric_resonance`), in
s = w0 t and centred on n w/2,

    A' = [-zeta + i (1 + a - n nu/2)] A + i B conj(A),    nu = w/w0

has real exponents -zeta +- sqrt(|B|^2 - (1 + a - n nu/2)^2), so that the edges of the tongue are at

    nu = (2/n) [1 + a +- sqrt(|B|^2 - zeta^2)]

and there is no tongue where |B| < zeta. Through second order, at nu = 2/n,

    a = -zeta^2/2 - sum_{j>=1} |c_j|^2/(4 - 4 j^2/n^2)  (of j = n only its upper state, |c_n|^2/16)
    B = c_n/2 + products c_j c_l with j + l = n

which for 1 + eps cos(w t) gives nu = 2 +- eps/2 - eps^2/32 (n = 1), and nu = 1 + eps^2/24 and
1 - 5 eps^2/24 (n = 2). Coefficients of higher orders depend on nu, and the edge is iterated.

Limits: an asymptotic series; order K errs by order K+1 of the variation as long as neighbouring
tongues stay apart (n max|phi| well below 1). `zeta` is c/(2 sqrt(k0 m)), the same at every speed.

Sources: Magnus and Winkler, Hill's Equation, 1966, chapters 1 and 2; Nayfeh and Mook, Nonlinear
Oscillations, 1979, section 5.2; McLachlan, Theory and Application of Mathieu Functions, 1947 (n =
1, 2 undamped).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt
import scipy

from gearmon.arrays import BoolArray
from gearmon.dynamics import floquet
from gearmon.dynamics.amplitude_equations import MOST_ORDERS, Coupling, State, reduce
from gearmon.dynamics.fourier import Complex, Real, fast_length, samples, with_zero_mean
from gearmon.dynamics.hill import HillProblem, frozen_vector
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result


@dataclass(frozen=True, eq=False)
class FourierShape:
    """Shape f(t) of a stiffness k0 [1 + eps f(t)] by its Fourier coefficients.

    Parameters
    ----------
    harmonics : complex array, shape (J,)
        f_1..f_J, J >= 1: f = sum (f_j e^{ijwt} + conjugate). cos wt is [0.5].
    """

    harmonics: Complex

    def __post_init__(self) -> None:
        vector = frozen_vector("harmonics", self.harmonics)
        if not len(vector):
            raise ArgumentError("harmonics: give at least one coefficient")
        object.__setattr__(self, "harmonics", vector)

    @cached_property
    def values(self) -> Real:
        """F on equal steps of the period, 512 or more."""
        half = with_zero_mean(self.harmonics)
        return samples(half, fast_length(max(512, 16 * len(half))))

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest f."""
        return float(self.values.min()), float(self.values.max())


def shape_of(problem: HillProblem) -> tuple[FourierShape, float]:
    """Shape f(t) of a problem's stiffness with max f = 1, and the variation eps that belongs to it.

    Returns
    -------
    shape, variation
        eps = max k(t)/k0 - 1, so that an f of cos wt has the usual meaning.

    Raises
    ------
    ArgumentError
        If the stiffness does not vary.
    """
    c = problem.stiffness_harmonics
    top = _variation_of(problem).extremes[1]
    if not top > 0:
        raise ArgumentError("the stiffness does not vary: there is no shape to speak of")
    return FourierShape(c / top), top


def _variation_of(problem: HillProblem) -> FourierShape:
    """k(t)/k0 - 1 itself."""
    c = problem.stiffness_harmonics
    return FourierShape(c if len(c) else np.zeros(1, dtype=complex))


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityChart(Result):
    """Growth of free vibrations over a grid.

    Attributes
    ----------
    shape : FourierShape
        f(t).
    speeds : float ndarray, shape (X,)
        w/w0: mesh frequency over natural frequency.
    variations : float ndarray, shape (E,)
        eps.
    damping_ratio : float
    growth : float ndarray, shape (E, X)
        ln of the larger modulus of the two multipliers, per period; > 0 is unstable.
    """

    shape: FourierShape
    speeds: Real
    variations: Real
    damping_ratio: float
    growth: Real

    @property
    def largest_multiplier(self) -> Real:
        """Modulus of the larger multiplier, shape (E, X)."""
        return np.asarray(np.exp(self.growth))

    @property
    def unstable(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Where free vibrations grow, shape (E, X)."""
        return np.asarray(self.growth > 0)


def stability_chart(
    shape: FourierShape,
    speeds: npt.ArrayLike,
    variations: npt.ArrayLike,
    damping_ratio: float = 0.0,
    tolerance: float = 1e-10,
) -> StabilityChart:
    """Largest Floquet multiplier over (w/w0, eps).

    Parameters
    ----------
    shape : FourierShape
        f(t) of k0 [1 + eps f(t)].
    speeds : float array, shape (X,)
        Ratios w/w0, 0.001 to 1000.
    variations : float array, shape (E,)
        Relative eps, -100 to 100.
    damping_ratio : float
        zeta, 0 to 100.
    tolerance : float
        Of half the trace, 1e-15 to 0.1.

    Returns
    -------
    StabilityChart

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> chart = stability_chart(FourierShape([0.5]), [1.9, 2.0, 2.1], [0.1, 0.4])
    >>> chart.unstable.tolist()
    [[False, True, False], [True, True, True]]
    """
    x, eps = (np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (speeds, variations))
    for name, row, low, high in (("speeds", x, 1e-3, 1e3), ("variations", eps, -100.0, 100.0)):
        if row.ndim != 1:
            raise ArgumentError(f"{name}: shape {row.shape} must be one row")
        for value in (row.min(), row.max()):
            check_range(name, float(value), low, high)
    check_range("damping_ratio", damping_ratio, 0.0, 100.0)
    check_range("tolerance", tolerance, 1e-15, 0.1)
    most = x.size * eps.size // 2
    traces = floquet.half_traces_over(1 / x, eps, damping_ratio, shape.harmonics, tolerance, most)
    grown = floquet.growth(*traces(1 / x[None, :], eps[:, None])) - 2 * math.pi * damping_ratio / x
    return StabilityChart(
        shape=shape, speeds=x, variations=eps, damping_ratio=float(damping_ratio), growth=grown
    )


def excess(
    traces: floquet.HalfTraces, ratio: Real, variation: Real, zeta: float
) -> tuple[Real, Real]:
    """Smooth measure of instability, by which of +1 and -1 it comes.

    Returns
    -------
    plus, minus : float ndarray
        e^{-u} (+-H - cosh u), u = 2 pi R zeta: above zero where a multiplier lies beyond +1, or
        beyond -1.
    """
    value, log = traces(ratio, variation)
    decay = 2 * math.pi * zeta * ratio
    with np.errstate(over="ignore"):
        scaled = value * np.exp(np.minimum(log - decay, 700.0))
    level = (1 + np.exp(-2 * decay)) / 2
    return scaled - level, -scaled - level


SCAN_TOLERANCE = 1e-8
#: Highest w0/w for which the search is worth its time.
MOST_SEARCHED = 200.0


@dataclass(frozen=True, kw_only=True)
class StabilityMargin:
    """How far a system is from instability.

    Attributes
    ----------
    multipliers : (complex, complex)
        Floquet multipliers, the larger modulus first.
    variation_factor : float
        The stiffness variation k(t)/k0 - 1 may be multiplied by this before free vibrations grow;
        below 1 if they do already. Infinite if none does while k(t) stays > 0; NaN if not
        searched for.
    positive_factor : float
        Factor at which k(t) first touches zero: beyond it there is no spring.
    stable : bool
        Whether free vibrations die out.
    message : str
        One line with the numbers.
    """

    multipliers: tuple[complex, complex]
    variation_factor: float
    positive_factor: float
    stable: bool
    message: str


def stability_margin(problem: HillProblem, search: bool = True) -> StabilityMargin:
    """Multipliers of a problem, and the factor on its stiffness variation that makes it unstable.

    Parameters
    ----------
    problem : HillProblem
    search : bool
        Whether to look for `variation_factor`; where damping does not settle it at once, its cost
        grows as (w0/w)^2, and above w0/w = 200 it is not looked for.

    Notes
    -----
    The factor is the first at which a smooth function of it passes zero, looked for on a grid of
    16 points to each swing of the half trace and at all its maxima, above the variation that
    damping outdoes for certain.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> m = stability_margin(p)
    >>> m.stable, m.variation_factor, round(m.positive_factor, 3)
    (True, inf, 7.692)
    """
    shape = _variation_of(problem)
    ratio, zeta = problem.frequency_ratio, problem.damping_ratio
    pair = floquet.multipliers(ratio, zeta, shape.harmonics, 1e-12)
    grown = float(floquet.growth_of(ratio, 1.0, zeta, shape.harmonics))
    low = -shape.extremes[0]
    positive = 1 / low if low > 0 else math.inf
    factor = _first_unstable(shape, ratio, zeta, positive) if search else math.nan
    return StabilityMargin(
        multipliers=pair,
        variation_factor=factor,
        positive_factor=positive,
        stable=grown < 0,
        message=_margin_message(grown, zeta, factor, positive),
    )


def _margin_message(grown: float, zeta: float, factor: float, positive: float) -> str:
    verb = "grow" if grown > 0 else "shrink"
    text = f"free vibrations {verb} by the factor {math.exp(min(grown, 700.0)):.6g} a period"
    if zeta == 0 and grown <= 0:
        text = "undamped: free vibrations neither grow nor die out"
    if math.isnan(factor):
        return text
    if math.isinf(factor):
        return f"{text}; no variation that keeps k(t) > 0 (up to {positive:.4g} times) is unstable"
    return f"{text}; unstable from {factor:.6g} times the stiffness variation on"


def _first_unstable(shape: FourierShape, ratio: float, zeta: float, most: float) -> float:
    """Smallest factor in (0, most) with a multiplier beyond the unit circle."""
    if not math.isfinite(most):
        return math.inf
    least = certainly_stable_up_to(shape, ratio, zeta, most)
    if least >= most:
        return math.inf
    if ratio > MOST_SEARCHED:
        return math.nan
    grid = np.linspace(least, most, 64 + 16 * math.ceil(2 * ratio) + 1)

    def values(factors: Real | float, tolerance: float = 1e-12) -> Real:
        known = partial(floquet.half_traces, zeta=zeta, harmonics=shape.harmonics)
        traces = partial(known, tolerance=tolerance)
        return np.maximum(*excess(traces, np.array(ratio), np.asarray(factors), zeta))

    return _first_crossing(lambda s: float(values(s)), grid, values(grid, SCAN_TOLERANCE))


def certainly_stable_up_to(shape: FourierShape, ratio: float, zeta: float, most: float) -> float:
    """Return a factor on f(t) below which damping outdoes any growth, at most `most`.

    With q = 1 - zeta^2 + s f, y'' + q y = 0 cannot grow by more than ln: int s|f| dt/(2 sqrt(1 -
    zeta^2)) per period (from y'^2 + (1 - zeta^2) y^2), nor by more than a quarter of the total
    variation of ln q (from (y'^2 + q y^2)/sqrt q).
    """
    if not 0 < zeta < 1:
        return 0.0
    values, rest = shape.values, 1 - zeta**2
    by_size = 2 * zeta * math.sqrt(rest) / float(np.abs(values).mean())
    low, high = 0.0, min(most, 0.999 * rest / max(1e-300, -float(values.min())))
    for _ in range(40):
        middle = (low + high) / 2
        logs = np.log(rest + middle * values)
        total = float(np.abs(logs - np.roll(logs, 1)).sum())
        if 1.02 * total / 4 < 2 * math.pi * ratio * zeta:
            low = middle
        else:
            high = middle
    return min(most, max(0.99 * by_size, low))


def _first_crossing(function: Callable[[float], float], grid: Real, values: Real) -> float:
    """Smallest s with function(s) > 0, also between grid points where it has a maximum."""
    # a system without variation is on the boundary at most
    above = np.flatnonzero(values[1:] > 1e-14) + 1
    first = int(above[0]) if len(above) else len(grid)
    inner = np.arange(1, min(first, len(grid) - 1))
    peaks = inner[(values[inner] >= values[inner - 1]) & (values[inner] >= values[inner + 1])]
    low, high = grid[first - 1], grid[first] if first < len(grid) else math.inf
    for peak in peaks:
        ends = grid[peak - 1], grid[peak + 1]
        top = scipy.optimize.minimize_scalar(
            lambda s: -function(s), bounds=ends, options={"xatol": 1e-9 * ends[1]}
        )
        if -top.fun > 1e-14:
            low, high = ends[0], float(top.x)
            break
    if math.isinf(high):
        return math.inf
    return float(scipy.optimize.brentq(function, low, high, xtol=1e-15 * high, rtol=1e-14))


MOST_HARMONICS = 600
MOST_TONGUE = 200
#: Damping ratio up to which tongues are sought.
MOST_DAMPING = 0.999
#: A tongue whose excess stays below this is closed as far as rounding can tell.
CLOSED = 1e-13
#: Rounds of the search for the top of a tongue, and points of each.
PEAK_ROUNDS, PARTS = 7, 9
#: Error of half traces where edges are told to rounding.
ROUNDED = 1e-12


def tongue_edges(
    shape: FourierShape, tongue: int, variations: npt.ArrayLike, damping_ratio: float = 0.0
) -> Real:
    """Lower and upper w/w0 of an unstable tongue.

    Parameters
    ----------
    shape : FourierShape
        f(t) of k0 [1 + eps f(t)].
    tongue : int
        n, 1 to 200: the tongue that starts from w/w0 = 2/n.
    variations : float array, shape (E,)
        eps; k(t) must stay > 0.
    damping_ratio : float
        zeta, 0 to below 1.

    Returns
    -------
    float ndarray, shape (E, 2)
        NaN where damping closes the tongue; undamped, both edges are given even if they coincide.
        Exact but for rounding: about 1e-14, or 1e-15 divided by the tongue's width where it is
        narrow and damped.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> low, high = tongue_edges(FourierShape([0.5]), 1, [0.1])[0]
    >>> float(round(low, 9)), float(round(high, 9))
    (1.949698438, 2.049678773)
    """
    check_range("tongue", tongue, 1, MOST_TONGUE)
    check_range("damping_ratio", damping_ratio, 0.0, MOST_DAMPING)
    eps = np.atleast_1d(np.asarray(variations, dtype=np.float64))
    least = 1 + np.minimum(eps * shape.extremes[0], eps * shape.extremes[1])
    if eps.ndim != 1 or not (least > 0).all():
        raise ArgumentError(
            f"variations: one of them makes the stiffness {least.min():.4g} times its mean; "
            "it must stay > 0"
        )
    return Boundaries(shape, damping_ratio, [tongue], eps).edges(tongue, eps)


def _matrices(f: Complex, tongue: int, eps: Real, highest: int) -> Complex | Real:
    """1/m (I + eps F) 1/j, without the static row, whose harmonic follows the others."""
    odd = tongue % 2
    order = np.arange(-highest, highest + 1 - odd) + odd / 2
    column = np.zeros(len(order), dtype=complex)
    column[1 : 1 + len(f)] = f[: len(order) - 1]
    if np.abs(f.imag).max() <= 1e-15 * np.abs(f).max():
        column = column.real
    # Hermitian: the first row is the conjugate of the first column
    matrix = eps[:, None, None] * scipy.linalg.toeplitz(column) + np.eye(len(order))
    if not odd:
        keep = order != 0
        static = matrix[:, keep][:, :, ~keep]
        matrix = matrix[:, keep][:, :, keep] - static @ static.conj().transpose(0, 2, 1)
        order = order[keep]
    return np.asarray(matrix / np.outer(order, order))


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Where some tongues of one shape and damping ratio begin and end, at eps that some span."""

    shape: FourierShape
    zeta: float
    tongues: Sequence[int]
    variations: Real

    @cached_property
    def traces(self) -> floquet.HalfTraces:
        """Half traces in the rectangle that holds the tongues."""
        around = np.array([self.around(tongue, self.variations) for tongue in self.tongues])
        most = PEAK_ROUNDS * PARTS * len(self.variations) * len(self.tongues)
        known = self.zeta, self.shape.harmonics, ROUNDED, most
        return floquet.half_traces_over(1 / around, self.variations, *known)

    def around(self, tongue: int, eps: Real) -> Real:
        """Interval of w/w0 that holds the damped tongue, shape (E, 2)."""
        rest, f = 1 - self.zeta**2, self.shape.harmonics
        # without damping, by the Hermitian eigenvalues
        highest = min(MOST_HARMONICS, tongue + 2 * len(f) + 24)
        matrices = _matrices(f[: 2 * highest], tongue, eps / rest, highest)
        first = 2 * ((tongue - 1) // 2)
        squares = np.linalg.eigvalsh(matrices)[:, ::-1][:, first : first + 2]
        return np.asarray(np.sqrt(rest * np.maximum(squares, 0.0))[:, ::-1])

    def excess(self, tongue: int, x: Real, eps: Real) -> Real:
        """Measure of growth at w/w0, above zero within the tongue."""
        return excess(self.traces, 1 / x, eps, self.zeta)[tongue % 2]

    def top(self, tongue: int, eps: Real) -> tuple[BoolArray, Real, Real]:
        """Whether a tongue is open, w/w0 at which it grows most, and what is around it."""
        rows, around = np.arange(len(eps)), self.around(tongue, eps)
        low, high = around.T
        for _ in range(PEAK_ROUNDS):
            x = np.linspace(low, high, PARTS, axis=1)
            values = self.excess(tongue, x, eps[:, None])
            best = np.argmax(values, axis=1)
            low, high = x[rows, np.maximum(best - 1, 0)], x[rows, np.minimum(best + 1, PARTS - 1)]
        return values[rows, best] > CLOSED, x[rows, best], around

    def edges(self, tongue: int, eps: Real) -> Real:
        """Lower and upper w/w0, as `tongue_edges`."""
        from scipy.optimize.elementwise import find_root

        if self.zeta == 0:
            return self.around(tongue, eps)
        grows, top, around = self.top(tongue, eps)
        edges = np.full(around.shape, np.nan)
        for column in (0, 1) if grows.any() else ():
            edges[grows, column] = find_root(
                lambda x, some: self.excess(tongue, x[:, None], some[:, None])[:, 0],
                (around[grows, column], top[grows]),
                args=(eps[grows],),
                tolerances={"xatol": 0.0, "xrtol": 4e-16, "fatol": 0.0, "frtol": 0.0},
            ).x
        return edges


MOST_ITERATIONS = 60


def expanded_tongue(
    harmonics: npt.ArrayLike, number: int, zeta: float = 0.0, order: int = 2
) -> tuple[float, float] | None:
    """Lower and upper edge w/w0 of the n-th tongue, to some order of the variation.

    Parameters
    ----------
    harmonics : complex array, shape (J,)
        c_1..c_J of phi; eps cos(wt) has c_1 = eps/2.
    number : int
        n >= 1.
    zeta : float
        Damping ratio, 0 to 0.99; counted as order one.
    order : int
        K >= 1: highest order of the amplitude equation.

    Returns
    -------
    (float, float) or None
        Edges w/w0; None if damping leaves no tongue at this order.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the edges of an order above two do not settle.

    Examples
    --------
    >>> low, high = expanded_tongue([0.1], 1)    # eps = 0.2
    >>> round(low, 5), round(high, 5), 2 - 0.1 - 0.04 / 32, 2 + 0.1 - 0.04 / 32
    (1.89875, 2.09875, 1.89875, 2.09875)
    >>> expanded_tongue([0.1], 1, zeta=0.051) is None    # eps < 4 zeta
    True
    """
    c = frozen_vector("harmonics", harmonics)
    check_range("number", number, 1, 10_000)
    check_range("order", order, 1, MOST_ORDERS)
    check_range("zeta", zeta, 0.0, 0.99)
    edges = [_edge(c, number, zeta, order, side) for side in (-1, 1)]
    found = [edge for edge in edges if edge is not None]
    return (min(found), max(found)) if len(found) == 2 else None


def _edge(c: Complex, number: int, zeta: float, order: int, side: int) -> float | None:
    """Edge by the coefficients at w/w0 = nu, from nu = 2/n on; above order two iterated."""
    found, change, centre = 2 / number, math.inf, 2 / number
    for _ in range(MOST_ITERATIONS):
        coupling = Coupling(ratio=1 / found, zeta=zeta, harmonics=c, small_damping=True)
        slow: list[State] = [(1, number / 2), (-1, -number / 2)]
        total = np.asarray(reduce(coupling, slow, 0, order).rates[1:].sum(axis=0))
        square = abs(total[0, 1]) ** 2 - total[0, 0].real ** 2
        if square < 0:
            return None
        better = centre * (1 + float(total[0, 0].imag) + side * math.sqrt(square))
        change, found = abs(better - found), better
        if order <= 2 or change <= 1e-14 * centre:
            return found
        if not 0.5 * centre < found < 2 * centre:
            break
    if change <= 1e-12 * centre:
        return found
    raise ArgumentError(
        f"number={number}: order {order} of multiple scales gives no edge at this variation of "
        "stiffness (the iteration does not settle); use order=2 or Floquet multipliers"
    )


#: Part of the variation that brings k(t) to zero up to which a map is drawn.
HIGHEST_SHARE = 0.98
MOST_TONGUES = 14
TIP_HALVINGS = 8
#: Harmonics of the stiffness, beyond the tongue's number, that multiple scales gets.
HARMONICS = 24
#: n max|phi| beyond which neighbouring tongues mix and multiple scales is no boundary at all.
MOST_COUPLED = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Tongue(Result):
    """Boundaries of one unstable tongue.

    Attributes
    ----------
    number : int
        n: it starts from w/w0 = 2/n.
    variations : float ndarray, shape (E,)
        eps.
    exact : float ndarray, shape (E, 2)
        Lower and upper w/w0; NaN where the tongue is closed.
    expanded : dict of int to float ndarray, shape (E, 2)
        The same by multiple scales, by order; NaN also where n max|phi| > 3, far beyond its range.
    """

    number: int
    variations: Real
    exact: Real
    expanded: dict[int, Real]


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityMap(Result):
    """All that a picture of stability shows.

    Attributes
    ----------
    chart : StabilityChart
    tongues : tuple of Tongue
    mark : (float, float) or None
        w/w0 and eps of a machine.
    """

    chart: StabilityChart
    tongues: tuple[Tongue, ...]
    mark: tuple[float, float] | None


def stability_map(
    shape: FourierShape,
    damping_ratio: float = 0.0,
    speeds: tuple[float, float] = (0.45, 2.6),
    highest_variation: float | None = None,
    orders: tuple[int, ...] = (1, 2),
    mark: tuple[float, float] | None = None,
    points: tuple[int, int] = (320, 120),
) -> StabilityMap:
    """Compute chart and boundaries over a rectangle of w/w0 and eps >= 0.

    Parameters
    ----------
    shape : FourierShape
        f(t) of k0 [1 + eps f(t)].
    damping_ratio : float
        zeta, 0 to 100; from 0.999 on no tongues are followed.
    speeds : (float, float)
        Range of w/w0, > 0. The fourteen tongues with the lowest numbers in it are followed.
    highest_variation : float, optional
        Largest eps; by default 0.98 of what brings k(t) to zero, at most 1.
    orders : tuple of int
        Orders of multiple scales to show, 1 to 12; empty for none.
    mark : (float, float), optional
        w/w0 and eps of a machine.
    points : (int, int)
        Grid points along w/w0 and eps, >= 2.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    """
    low, high = (check_range("speeds", x, 2 / MOST_TONGUE, 1e3) for x in speeds)
    if low >= high:
        raise ArgumentError(f"speeds={speeds}: the first must be smaller than the second")
    for count in points:
        check_range("points", count, 2, 20_000)
    limit = HIGHEST_SHARE / -shape.extremes[0]
    if highest_variation is None:
        highest_variation = min(1.0, limit)
    check_range("highest_variation", highest_variation, 1e-6, limit)
    x, eps = np.linspace(low, high, points[0]), np.linspace(0.0, highest_variation, points[1])
    chart = stability_chart(shape, x, eps, damping_ratio)
    # tongues bend to lower speeds, so that some begin outside
    first, last = max(1, math.ceil(1.7 / high)), math.floor(2 / low)
    # what is damped so much has none: nothing swings
    last = min(last, first + MOST_TONGUES - 1, MOST_TONGUE) if damping_ratio <= MOST_DAMPING else 0
    numbers = range(first, last + 1)
    coarse = highest_variation * np.linspace(0.0, 1.0, 49)
    boundaries = Boundaries(shape, damping_ratio, numbers, coarse)
    tongues = []
    for n in numbers:
        # fine at the tips
        eps = np.unique(np.concatenate([coarse[1:], _near_tips(boundaries, n, coarse)]))
        expanded = {k: _expanded(shape, n, eps, damping_ratio, k) for k in orders}
        exact = boundaries.edges(n, eps)
        tongues.append(Tongue(number=n, variations=eps, exact=exact, expanded=expanded))
    return StabilityMap(chart=chart, tongues=tuple(tongues), mark=mark)


def _expanded(shape: FourierShape, number: int, eps: Real, zeta: float, order: int) -> Real:
    """Edges by multiple scales, shape (E, 2); NaN where they find none, or mean nothing."""
    harmonics = shape.harmonics[: number + HARMONICS]
    largest = max(shape.extremes[1], -shape.extremes[0])
    edges = np.full((len(eps), 2), np.nan)
    for row, variation in enumerate(eps):
        if number * variation * largest > MOST_COUPLED:
            continue
        try:
            found = expanded_tongue(variation * harmonics, number, zeta, order)
        except ArgumentError:
            # the iteration of a high order does not settle: there is nothing to show
            found = None
        if found is not None:
            edges[row] = found
    return edges


def _near_tips(boundaries: Boundaries, number: int, grid: Real) -> Real:
    """Variations that crowd towards where the tongue opens or closes."""
    is_wide = boundaries.top(number, grid)[0]
    change = np.flatnonzero(is_wide[1:] != is_wide[:-1])
    if not len(change):
        return np.zeros(0)
    opens = is_wide[change + 1]
    wide, shut = grid[change + opens], grid[change + ~opens]
    away = wide
    for _ in range(TIP_HALVINGS):
        middle = (shut + wide) / 2
        opened = boundaries.top(number, middle)[0]
        wide, shut = np.where(opened, middle, wide), np.where(opened, shut, middle)
    # edges leave a tip like a square root
    share = np.linspace(0.0, 1.0, 9)[:-1] ** 2
    return np.asarray((wide[:, None] + (away - wide)[:, None] * share).ravel())


def stability_map_of(
    problem: HillProblem, orders: tuple[int, ...] = (1, 2), points: tuple[int, int] = (320, 120)
) -> StabilityMap:
    """Map around a problem, with its own stiffness form and damping, and a mark at its place.

    Parameters
    ----------
    problem : HillProblem
        w/w0 from 0.01; eps is max k(t)/k0 - 1.
    orders, points
        As of `stability_map`.

    Raises
    ------
    ArgumentError
        If the stiffness does not vary, or the problem lies outside of what can be drawn.
    """
    shape, eps = shape_of(problem)
    x = 1 / problem.frequency_ratio
    usual = (0.45, 2.6)
    speeds = usual if usual[0] < x < usual[1] else (0.85 * x, 1.2 * x)
    limit = HIGHEST_SHARE / -shape.extremes[0]
    highest = min(limit, max(1.2 * eps, min(1.0, limit)))
    return stability_map(shape, problem.damping_ratio, speeds, highest, orders, (x, eps), points)
