"""What is left of a gear's pattern after the healthy one has been fitted to it.

Both patterns, synchronous averages as complex lines, are turned to the same angle. About each mesh
harmonic the healthy one may then change by a complex gain that varies slowly across the band: load,
sensor gain and mounting change the gain, a small change of speed moves every line to another place
of the path's response and makes the gain vary. Pitch errors and eccentricities of the machine
itself cancel. The rest comes with the variance that the scatter of either recording leaves to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.gear_pattern import GearPattern, mesh_bands
from gearmon.diagnosis.gear_turning import turning_beside_event
from gearmon.signatures.reference import WheelPattern

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

# Terms of the gain's polynomial across a band; a speed changed by two per cent needs three.
_GAIN_TERMS = 3
# Lines that each fitted number needs, lest the fit take away what it is to leave.
_LINES_A_NUMBER = 4
# Sidebands this near to a mesh harmonic belong to eccentricity and misalignment, not to one tooth.
NEAR = 2
_LEAST_LINES = 4
# Damping ratio of the path's modes: a speed changed by twice as large a share moves a line across.
_PATH_DAMPING = 0.03
# Lines to either side that tell how loud the pattern is about a line.
_BESIDE = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class BandDifference:
    """Rest of the lines about one mesh harmonic.

    Parameters
    ----------
    harmonic : int
        Mesh harmonic, from 1.
    number : ndarray of int, shape (lines,)
        Multiples of the gear's rotation.
    rest : ndarray of complex, shape (channels, lines)
        New less fitted healthy amplitude, in units of its own standard deviation, corrected for
        what the fit takes away: without a change its mean square is 1.
    deviation : ndarray of float, shape (channels, lines)
        That standard deviation [unit of the channel].
    """

    harmonic: int
    number: IntArray
    rest: ComplexArray
    deviation: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class CoherentDifference:
    """Rest of one gear's pattern.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        Gear.
    teeth : int
        Teeth.
    order : float
        Rotation of the gear, in turns of shaft 1.
    bands : tuple of BandDifference
        Bands with enough lines, by harmonic.
    mesh_power : ndarray of float, shape (channels, harmonics + 1)
        |A|^2 of the mesh harmonics in the new recording, 0 where not measured.
    shift_turns : float
        Angle zero of the (first) healthy recording, in turns of this gear after that of the new
        one; 0 where nothing had to be turned.
    patterns : int
        Healthy patterns that were fitted; 0 if the gear was compared with nothing.
    """

    stage: int
    gear: str
    teeth: int
    order: float
    bands: tuple[BandDifference, ...]
    mesh_power: FloatArray
    shift_turns: float
    patterns: int


def coherent_difference(
    wheel: WheelPattern,
    channels: Sequence[int],
    healthy: Sequence[WheelPattern],
    healthy_channels: Sequence[int],
    *,
    same_zero: bool,
    moved: Sequence[float] = (),
) -> CoherentDifference | None:
    """Subtract the healthy patterns of a gear from a new one.

    Parameters
    ----------
    wheel : WheelPattern
        The gear in the new recording.
    channels : sequence of int
        Its channels to use.
    healthy : sequence of WheelPattern
        The same gear in healthy recordings; empty to leave the new pattern as it is.
    healthy_channels : sequence of int
        The same channels there.
    same_zero : bool
        Whether angle zero is the same position of the gear in all: then nothing is turned.
    moved : sequence of float, optional
        Speed of the new recording over that of each healthy one, less 1; zero if not given.

    Returns
    -------
    CoherentDifference or None
        None if too few lines are resolved.

    Notes
    -----
    About mesh harmonic k of a gear with z teeth, A_n ~ sum_r sum_p g_rp x^p B_rn with
    x = n/z - k, p = 0..2, of as many healthy patterns B_r as the lines of the band can carry, by
    least squares weighted with 1/(var A + |g|^2 var B). Where the speed has changed by a share d,
    every line stands elsewhere among the modes of the path, whose width is a share 2 zeta = 0.06
    of their frequency. The gain then leaves what its polynomial cannot follow, amplitudes of a
    share d/(2 zeta) of the pattern about the line, whose square is added to the variance.
    """
    patterns = (wheel, *healthy)
    if not all(len(pattern.number) for pattern in patterns):
        return None
    top = min(int(pattern.number.max()) for pattern in patterns)
    new = GearPattern.of(wheel, channels, top)
    bands = mesh_bands(wheel.teeth, top)
    change = np.asarray(moved) if len(moved) else np.zeros(len(healthy))
    left = np.minimum(1.0, np.abs(change) / (2.0 * _PATH_DAMPING))
    known, shift = [], 0.0
    for row, pattern in enumerate(healthy):
        own = GearPattern.of(pattern, healthy_channels, top)
        angle = 0.0 if same_zero else turning_beside_event(own, new, bands, wheel.teeth)
        shift = angle if row == 0 else shift
        known.append(own.turned(angle))
    parts = tuple(_band_differences(new, known, bands, wheel.teeth, left))
    if not parts:
        return None
    return CoherentDifference(
        stage=wheel.stage,
        gear=wheel.gear,
        teeth=wheel.teeth,
        order=wheel.order,
        bands=parts,
        mesh_power=np.abs(new.amplitude[:, :: wheel.teeth]) ** 2,
        shift_turns=shift,
        patterns=len(known),
    )


def _band_differences(
    new: GearPattern,
    known: Sequence[GearPattern],
    bands: Sequence[IntArray],
    teeth: int,
    left: FloatArray,
) -> Iterator[BandDifference]:
    usable = new.usable.copy()
    for pattern in known:
        usable &= pattern.usable
    for harmonic, band in enumerate(bands, start=1):
        use = band[usable[band]]
        offset = use - teeth * harmonic
        far = np.abs(offset) > NEAR
        if far.sum() < _LEAST_LINES:
            continue
        rest = np.empty((len(new.amplitude), int(far.sum())), dtype=complex)
        deviation = np.empty(rest.shape)
        for channel in range(len(rest)):
            fitted = _fit(
                new.amplitude[channel, use],
                new.variance[channel, use],
                np.array([pattern.amplitude[channel, use] for pattern in known]),
                np.array([pattern.variance[channel, use] for pattern in known]),
                offset / teeth,
                left,
            )
            rest[channel], deviation[channel] = fitted[0][far], fitted[1][far]
        yield BandDifference(harmonic=harmonic, number=use[far], rest=rest, deviation=deviation)


def _fit(
    value: ComplexArray,
    variance: FloatArray,
    basis: ComplexArray,
    basis_variance: FloatArray,
    place: FloatArray,
    share: FloatArray,
) -> tuple[ComplexArray, FloatArray]:
    """Whitened rest of a band after the healthy patterns, and its standard deviation."""
    room = len(value) // _LINES_A_NUMBER
    if not len(basis) or room < 1:
        deviation = np.sqrt(variance)
        return value / deviation, deviation
    chosen = _most_similar(value, variance, basis, max(1, min(len(basis), room // _GAIN_TERMS)))
    terms = min(_GAIN_TERMS, max(1, room // len(chosen)))
    powers = place ** np.arange(terms)[:, None]
    columns = (basis[chosen][:, None, :] * powers).reshape(-1, len(value))
    gain = np.zeros(len(columns), dtype=complex)
    # the noise of a healthy pattern is heard through its gain, so the weights need the gain first
    total = variance + basis_variance[chosen].mean(axis=0)
    for _ in range(2):
        weight = 1.0 / np.sqrt(total)
        gain = np.linalg.lstsq((columns * weight).T, value * weight, rcond=None)[0]
        across = np.abs(gain.reshape(len(chosen), terms) @ powers) ** 2
        heard = _about_lines(across * np.abs(basis[chosen]) ** 2, place != 0)
        total = variance + np.sum(across * basis_variance[chosen], axis=0)
        total = total + share[chosen] ** 2 @ heard
    deviation = np.sqrt(total)
    left = np.sqrt(len(value) / max(1, len(value) - len(columns)))
    return (value - gain @ columns) / deviation * left, deviation


def _about_lines(power: FloatArray, told: NDArray[np.bool_]) -> FloatArray:
    """Mean power of the lines about each, those not told left out."""
    window = np.ones(2 * _BESIDE + 1)
    # cut by hand: of a band shorter than the window numpy would return the window's length
    own = slice(_BESIDE, _BESIDE + len(told))
    count = np.convolve(told, window)[own]
    total = [np.convolve(np.where(told, row, 0.0), window)[own] for row in power]
    mean: FloatArray = np.array(total) / np.maximum(count, 1.0)
    return mean


def _most_similar(
    value: ComplexArray, variance: FloatArray, basis: ComplexArray, count: int
) -> IntArray:
    """Choose the healthy patterns that are most like the new one in this band."""
    weight = 1.0 / variance
    match = np.abs((basis.conj() * weight) @ value) ** 2
    match /= np.maximum(np.sum(np.abs(basis) ** 2 * weight, axis=1), np.finfo(float).tiny)
    return np.sort(np.argsort(match, kind="stable")[::-1][:count])
