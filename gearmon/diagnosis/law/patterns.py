"""A gear's lines around its turn, and the angle at which two recordings of it are alike.

A healthy pattern is turned to a new one, whatever one damaged tooth does to it: that may be louder
than all else, and draws the pattern to whichever healthy tooth departs most. An engine, a joint or
a load that pulsates turns a gear unevenly, and as each start has it: the pattern is then told as it
is where the gear turns as unevenly as in the new recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.signatures.measured.reference import WheelPattern

#: Standard deviation of the complex gain of a band about one: healthy simulated pairs from 40 to
#: 115 % load with sensor gains left alone stay within 0.2.
GAIN = 0.3
#: Lines that a band needs to tell anything.
LEAST_LINES = 4
#: Sidebands this near to a mesh harmonic belong to what turns unevenly, to eccentricity and
#: misalignment, not to one tooth.
NEAR = 2
# A gear turns unevenly up to so many times a turn (four cylinders fire twice a turn); standard
# deviation of its angle at the first mesh harmonic [rad], and errors of sidebands by the path, over
# the mesh harmonic. Highest mesh harmonic by which the angle is told, time after time: those above
# turn by more than a radian until it is known.
_PULSES, _UNEVEN, _PATH, _HARMONICS = 4, 0.1, 0.1, 3
_UP_TO, _BAND_ROUNDS = (3, 3, 6, 12, 1000, 1000), 3
# It is told where the logarithm of likelihood gains so many times what is left of it a line, from
# this angle on [rad], where the highest order has less than this share of its power: of one tooth
# all orders are alike, and its crack would be taken for it. Gears driven unevenly gain 12 to 370 by
# an angle of 0.009 to 0.06, those of a real rig whose load changes up to 10; lightly loaded ones up
# to 50, nearly always by less than 0.006 or by orders alike.
_TOLD, _FAINT, _HIGHEST = 12.0, 0.006, 0.1
# Two angles, with the near sidebands and without, are one within so many teeth; the second is taken
# where it leaves so much less at the others: of 60 sound recordings of gears driven unevenly it
# left 0.57 to 0.83 where the first was wrong, 0.93 and more where it was right.
_ANOTHER, _LEFT = 0.2, 0.85
# Angles that are tried, a good half of a tooth apart, and the share of the teeth, the quietest,
# that choose among them: a damaged tooth and those about it must not.
_ANGLES, _APART, _SOUND_TEETH = 8, 0.4, 0.7
# Mesh harmonics tell where within a tooth a faint pattern stands: the lowest that both recordings
# show so far above noise, the share of phases that may tell nothing, one over the variance of the
# others [rad^-2], and steps of a cycle of the highest. On a real rig they were kept within 55 deg
# from no load to 80 % wherever the lines beside them told the angle clearly. Of 40 faint patterns
# 39 stand within a fifth of a tooth beside a whole number with them, 25 without.
_MESH_LINES, _MESH_HEARD, _MESH_LOST, _MESH_KEPT, _MESH_STEPS = 4, 10.0, 0.05, 4.0, 16
# An angle is clear that leaves less than this share of what any other one does: of sound gears of
# 24 lumped machines four in five have such a one, where two damaged teeth turned a gear wrongly the
# first left 0.85 to 0.93 of the second. It only saves time: beside all others it is judged as well.
_CLEAR = 0.4
#: All that is heard of an event is fitted so many teeth before and after its middle, the ringing of
#: the housing included, by waves half a tooth apart; directions below this share of the largest
#: singular value are noise.
AROUND, _RANK = np.arange(-2.0, 5.25, 0.5), 1e-2
# It counts from this energy over that of the median place on. Its energy is summed over so many
# teeth, at so many places a tooth.
_EVENT, _EVENT_TEETH, _PLACES = 6.0, 3, 8


@dataclass(frozen=True, kw_only=True, eq=False)
class GearPattern:
    """A gear's lines on a full grid 0..top of multiples of its rotation.

    Parameters
    ----------
    amplitude : ndarray of complex, shape (sides, channels, top + 1)
        Lines; 0 where none was measured. One side, the lines themselves; where planets pass the
        sensor, two more of those beside them (`WheelPattern.beside`).
    variance : ndarray of float, shape (sides, channels, top + 1)
        Mean square error of each.
    usable : ndarray of bool, shape (sides, top + 1)
        Whether the line was measured there and is no mesh harmonic of any stage.
    """

    amplitude: ComplexArray
    variance: FloatArray
    usable: NDArray[np.bool_]

    @classmethod
    def of(cls, wheel: WheelPattern, top: int) -> GearPattern:
        """Return the pattern up to a multiple of the rotation."""
        inside, tiny = wheel.number <= top, np.finfo(float).tiny
        number = wheel.number[inside]
        lines = np.stack([wheel.amplitude, *wheel.beside])[..., inside]
        error = np.stack([np.maximum(wheel.variance, tiny), *wheel.beside_variance])[..., inside]
        amplitude = np.zeros((*lines.shape[:2], top + 1), dtype=complex)
        variance, usable = np.ones(amplitude.shape), np.zeros((len(lines), top + 1), dtype=bool)
        amplitude[..., number], variance[..., number] = lines, np.where(error > 0, error, 1.0)
        usable[:, number] = [~wheel.mesh[inside], *np.all(error[1:] > 0, axis=1)]
        return cls(amplitude=amplitude, variance=variance, usable=usable)

    @classmethod
    def combined(cls, patterns: Sequence[GearPattern], weight: FloatArray, top: int) -> GearPattern:
        """Return the weighted sum of patterns, up to a multiple that all of them reach."""
        own = slice(top + 1)
        return cls(
            amplitude=np.tensordot(weight, [p.amplitude[..., own] for p in patterns], 1),
            variance=np.tensordot(weight**2, [p.variance[..., own] for p in patterns], 1),
            usable=np.logical_and.reduce([p.usable[:, own] for p in patterns]),
        )

    @property
    def top(self) -> int:
        """Highest multiple of the rotation."""
        return int(self.usable.shape[1]) - 1

    def turned(self, angle: float) -> GearPattern:
        """Return the same pattern `angle` turns later."""
        turn = np.exp(2j * np.pi * angle * np.arange(self.top + 1))
        return replace(self, amplitude=self.amplitude * turn)

    def turned_to(self, new: GearPattern, teeth: int) -> tuple[GearPattern, float]:
        """Return the same pattern at the angles of another, and by how many turns it is later.

        The carrier stands anywhere when the gear comes to the same angle again: that turns all
        lines at one place beside the gear's by one phase.
        """
        angle = turning(self, new, teeth)
        # without the near sidebands another angle may be found: of both that which leaves less
        other = turning(self, new, teeth, NEAR) if len(self.usable) == 1 else angle
        if abs((other - angle + 0.5) % 1.0 - 0.5) * teeth >= _ANOTHER:
            both = (self.turned(each).modulated_as(new, teeth) for each in (angle, other))
            left = [_Pair(known, new, teeth, NEAR).left(np.zeros(1))[0] for known in both]
            angle = other if left[1] < _LEFT * left[0] else angle
        found = self.turned(angle)
        told = found.amplitude.conj() * new.amplitude / (found.variance + new.variance)
        phase = np.where(self.usable & new.usable, told.sum(axis=1), 0.0).sum(axis=1)
        phase[0] = 1.0
        phase /= np.maximum(np.abs(phase), np.finfo(float).tiny)
        return replace(found, amplitude=found.amplitude * phase[:, None, None]), angle

    def modulated_as(self, new: GearPattern, teeth: int) -> GearPattern:
        """Return the same pattern, modulated as another is: of a gear that turns as unevenly.

        Parameters
        ----------
        new : GearPattern
            The other, of the same lines at the same angles.
        teeth : int
            z of the gear.

        Returns
        -------
        GearPattern
            Its near sidebands are those of the other, but for the gains of the mesh harmonics; the
            lines beyond are what follows from these. What changes is no surer than it is large:
            its square is added to the variance. Itself where planets pass the sensor, or where the
            other turns as evenly.

        Notes
        -----
        A gear that is delta(theta) ahead of its mean angle has b(theta) exp(i k z delta(theta)) for
        the band b of mesh harmonic k: one course of few orders, told by the near sidebands of all
        harmonics and channels by weighted least squares, Gauss-Newton from the lowest harmonics
        up. The torque pulsates with it, which any band answers in its own way: its near sidebands
        that are left tell the exponent of a gain around the turn.

        Of twelve lumped machines on which nothing here was set, driven unevenly by 0.3 and 0.6 per
        cent twice and half a time a turn, in another phase each time, 5 of 210 sound recordings
        were called faults without it, one is with it; of 400 cracks of 15 % 389 were found, 392
        are. Machines that turn evenly are told as before.
        """
        first = teeth - teeth // 2
        harmonics = (self.top + 1 - first) // teeth
        if len(self.usable) > 1 or harmonics < _HARMONICS or teeth <= 2 * _PULSES:
            return self
        inside = slice(first, first + harmonics * teeth)
        shape = (-1, harmonics, teeth)
        own, other = (each.amplitude[0, :, inside].reshape(shape) for each in (self, new))
        noise = (self.variance + new.variance)[0, :, inside].reshape(shape)
        bands = _Bands(own, other, noise)
        common = bands.common()
        if not common.any():
            return self
        moved = bands.modulated(common + bands.beyond(common)) - own
        change = np.where(own != 0, moved, 0.0).reshape(len(own), -1)
        amplitude, variance = self.amplitude.copy(), self.variance.copy()
        amplitude[0, :, inside] += change
        variance[0, :, inside] += np.abs(change) ** 2
        return replace(self, amplitude=amplitude, variance=variance)


class _Bands:
    """Lines about each mesh harmonic of two patterns, shape (channels, harmonics, teeth).

    The mesh harmonic is in their `middle`; `mesh` is the other's, 0 where one of both is not heard.
    Own bands `around` the turn have two steps a tooth.
    """

    def __init__(self, own: ComplexArray, other: ComplexArray, noise: FloatArray) -> None:
        self.own, self.other, self.noise = own, other, noise
        self.middle = middle = own.shape[2] // 2
        self.mesh = np.where(own[:, :, middle] != 0, other[:, :, middle], 0.0)
        self.around = np.fft.ifft(own, 2 * own.shape[2])

    def modulated(self, exponent: ComplexArray) -> ComplexArray:
        """Own lines times exp of a course, whose lines -_PULSES .. _PULSES are given."""
        size = self.around.shape[2]
        course = np.zeros((*exponent.shape[:2], size), dtype=complex)
        course[..., np.arange(-_PULSES, _PULSES + 1)] = exponent
        gain = np.exp(np.fft.ifft(course) * size)
        return np.asarray(np.fft.fft(self.around * gain)[..., : self.own.shape[2]])

    def left(self, exponent: ComplexArray) -> ComplexArray:
        """Return what own lines so modulated leave of the other's, one gain a harmonic."""
        lines, mesh = self.modulated(exponent), self.mesh
        own = lines[:, :, self.middle]
        gain = np.divide(mesh, own, out=np.zeros_like(own), where=own != 0)
        return np.asarray(self.other - gain[..., None] * lines)

    def common(self) -> ComplexArray:
        """Exponent of the angle by which the gear is ahead, which all bands have in common.

        Errors are taken to be spread as Cauchy's: a band whose mesh harmonic the path swallows
        must not tell it. Nothing where the gear turns evenly.
        """
        above, middle = np.arange(1, _PULSES + 1), self.middle
        order = np.arange(1, self.own.shape[1] + 1)
        at = np.r_[middle - above[::-1], middle + above]
        weight = 1.0 / (self.noise + _PATH**2 * np.abs(self.mesh[..., None]) ** 2)
        ahead, tried = np.zeros(_PULSES, dtype=complex), []
        for highest in (*_UP_TO, 0):
            course = np.r_[ahead[::-1].conj(), 0.0, ahead]
            exponent = 1j * order[None, :, None] * course
            left = self.left(exponent)
            off = np.log1p(weight * np.abs(left) ** 2)
            tried.append((float(off[self.mesh != 0][:, at].sum()), np.abs(ahead) ** 2, exponent))
            slope = np.where(order <= highest, 1j * order * self.mesh, 0.0)[..., None]
            told = weight * np.exp(-off)
            pull = slope.conj() * (told * left)[..., middle + above]
            pull += slope * (told * left)[..., middle - above].conj()
            power = np.abs(slope) ** 2 * (told[..., middle + above] + told[..., middle - above])
            ahead = ahead + pull.sum(axis=(0, 1)) / (power.sum(axis=(0, 1)) + 1.0 / _UNEVEN**2)
        least, power, best = min(tried, key=lambda one: one[0])
        smooth = power[-1] < _HIGHEST * power.sum() and power.max() > _FAINT**2
        lines = np.count_nonzero(self.mesh) * 2 * _PULSES
        clear = (tried[0][0] - least) * lines > _TOLD * least
        return best if smooth and clear else np.zeros_like(best)

    def beyond(self, common: ComplexArray) -> ComplexArray:
        """Exponents by which single bands are modulated beyond what they have in common.

        The torque pulsates with the angle, about as much; what an even turn shows beside a mesh
        harmonic is eccentricity, or a damaged tooth.
        """
        beside = np.r_[-NEAR:0, 1 : NEAR + 1]
        found = np.zeros((*self.own.shape[:2], 2 * _PULSES + 1), dtype=complex)
        mesh, near = self.mesh[..., None], self.middle + beside
        expected = np.sum(np.abs(common) ** 2, axis=2)[..., None]
        power = expected * np.abs(mesh) ** 2 + self.noise[..., near]
        told = expected * mesh.conj() / power
        for _ in range(_BAND_ROUNDS):
            found[..., _PULSES + beside] += told * self.left(common + found)[..., near]
            # what turns by more than a radian is no modulation
            found[np.sum(np.abs(found) ** 2, axis=2) > 1.0] = 0.0
        return found


def mesh_bands(teeth: int, top: int) -> list[IntArray]:
    """Return multiples of the rotation about each mesh harmonic, half a mesh order either way."""
    bands: list[IntArray] = []
    for k in range(1, (top + teeth // 2) // teeth + 1):
        low, high = max(1, k * teeth - teeth // 2), min(top, k * teeth + (teeth - 1) // 2)
        if high - low >= 3:
            bands.append(np.arange(low, high + 1))
    return bands


def turn_energy(lines: ComplexArray, number: IntArray, steps: int) -> FloatArray:
    """Energy of lines at equal steps of the turn, all channels together.

    Parameters
    ----------
    lines : ndarray of complex, shape (..., channels, lines)
    number : ndarray of int, shape (lines,)
        Multiples of the rotation; no two of them alike but for a multiple of `steps`.
    steps : int

    Returns
    -------
    ndarray of float, shape (..., steps)
    """
    folded = np.zeros((*lines.shape[:-1], steps), dtype=complex)
    folded[..., number % steps] = lines
    return np.asarray(np.sum(np.abs(np.fft.ifft(folded) * steps) ** 2, axis=-2))


def turning(known: GearPattern, new: GearPattern, teeth: int, beyond: int = 0) -> float:
    """Angle by which a healthy pattern must be turned, whatever one tooth does.

    Parameters
    ----------
    known, new : GearPattern
        A healthy pattern and a new one, of the same lines.
    teeth : int
        z of the gear.
    beyond : int, >= 0
        Sidebands of the mesh harmonics up to this one do not count.

    Returns
    -------
    float
        Turns. Of the angles at which the healthy pattern explains most of the new one, that which
        leaves least at most of the teeth: a damaged tooth may be louder than all else and draws the
        pattern to whichever healthy tooth departs most. Where none is clear, that at which the
        pattern and one event leave least together. Where within a tooth is told by the phases of
        the mesh harmonics as well, which the lines of a faint pattern must not overrule.
    """
    pair = _Pair(known, new, teeth, beyond)
    if not pair.bands:
        return 0.0
    angles = pair.likely_angles()
    left = pair.left(angles)
    best, second = np.sort(left)[:2]
    angle = float(angles[int(np.argmin(left))])
    event = None if best < _CLEAR * second else pair.event(angle)
    if event is None:
        return angle
    # an event that is loud, or of several teeth, leaks to all the others
    beside = replace(new, amplitude=new.amplitude - event)
    angles = np.append(angles, _Pair(known, beside, teeth, beyond).likely_angles())
    return float(angles[int(np.argmin(pair.beside_event(angles)))])


class _Pair:
    """A healthy pattern and a new one, about the mesh harmonics whose lines both have.

    `bands` are those in which so many lines are shared that they tell anything: numbers of the
    lines, healthy and new ones over the standard deviation of what differs, and that deviation, all
    sides and channels together.
    """

    def __init__(self, known: GearPattern, new: GearPattern, teeth: int, beyond: int) -> None:
        self.new, self.teeth, every = new, teeth, (-1, new.top + 1)
        usable = new.usable[0] & known.usable[0]
        away = (np.arange(len(usable)) + teeth // 2) % teeth - teeth // 2
        scale = np.sqrt(new.variance + known.variance)
        both = known.amplitude / scale, new.amplitude / scale, scale
        rows, bands = [own.reshape(every) for own in both], []
        for band in mesh_bands(teeth, new.top):
            use = band[usable[band] & (np.abs(away[band]) > beyond)]
            if len(use) >= LEAST_LINES:
                bands.append((use, *(own[:, use] for own in rows)))
        self.bands = bands
        at = np.arange(teeth, len(usable), teeth)
        one, two, error = (own[0, :, at].T for own in (known.amplitude, new.amplitude, scale))
        heard = np.minimum(np.abs(one), np.abs(two)) > np.sqrt(_MESH_HEARD) * error
        told = np.flatnonzero(heard.any(axis=0))[:_MESH_LINES]
        turn = np.where(heard, np.exp(1j * np.angle(two * one.conj())), 0.0)[:, told].sum(axis=0)
        turn /= np.maximum(1, heard[:, told].sum(axis=0))
        # it is alike for all teeth
        place = np.linspace(0.0, 1.0, 1 + _MESH_STEPS * (1 + int(told.max(initial=0))))
        kept = (turn * np.exp(-2j * np.pi * np.outer(place, 1 + told))).real - 1.0
        self.mesh = place, np.log(_MESH_LOST + np.exp(_MESH_KEPT * kept)).sum(axis=1)

    def by_mesh(self, angles: FloatArray) -> FloatArray:
        """Logarithm of how likely the phases of the mesh harmonics are, for each angle."""
        return np.asarray(np.interp(angles * self.teeth % 1.0, *self.mesh))

    def left(self, angles: FloatArray) -> FloatArray:
        """Mean energy left at most of the teeth, the quietest, for each angle."""
        quietest = np.sort(self._energy(angles, 1), axis=1)
        energy = quietest[:, : max(1, int(_SOUND_TEETH * self.teeth))].mean(axis=1)
        return np.asarray(energy - self.by_mesh(angles))

    def _energy(self, angles: FloatArray, places: int) -> FloatArray:
        """Energy left at so many places a tooth, for each angle; one gain a band is fitted."""
        energy = np.zeros((len(angles), places * self.teeth))
        for band, old, value, _ in self.bands:
            healthy = old * np.exp(2j * np.pi * np.outer(angles, band))[:, None]
            power = np.sum(np.abs(old) ** 2, axis=1)
            gain = np.sum(healthy.conj() * (value - healthy), axis=2)
            gain = 1.0 + gain / (power + 1.0 / GAIN**2)
            energy += turn_energy(value - gain[:, :, None] * healthy, band, energy.shape[1])
        return energy

    def _events(self, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angle zero [turns] of the event that each angle leaves, and how far it stands out."""
        energy = self._energy(angles, _PLACES)
        sizes = [round(teeth * _PLACES) for teeth in (_EVENT_TEETH, np.ptp(AROUND))]
        window, wide = (uniform_filter1d(energy, size, mode="wrap") for size in sizes)
        out = window.max(axis=1) / np.maximum(np.median(window, axis=1), np.finfo(float).tiny)
        return (np.argmax(wide, axis=1) / _PLACES - AROUND.mean()) / self.teeth, out

    @cached_property
    def _waves(self) -> list[ComplexArray]:
        """Of each band, all that an event at the angle zero can be, as orthonormal columns."""
        found = []
        for band, _, _, scale in self.bands:
            waves = np.exp(-2j * np.pi * np.outer(band, AROUND / self.teeth))
            found.append(spanned(waves / scale[:, :, None])[0])
        return found

    def event(self, angle: float) -> ComplexArray | None:
        """Lines of the greatest event in what the healthy pattern leaves; None if there is none.

        All that is heard there is fitted, not what the healthy pattern leaves of it: that would put
        the pattern in its place, at the very angle that is in doubt.
        """
        (place,), (out,) = self._events(np.array([angle]))
        if out < _EVENT:
            return None
        event = np.zeros(self.new.amplitude.reshape(-1, self.new.top + 1).shape, dtype=complex)
        for (band, _, value, scale), waves in zip(self.bands, self._waves, strict=True):
            turn = np.exp(2j * np.pi * place * band)
            event[:, band] = along(waves, value * turn) / turn * scale
        return event.reshape(self.new.amplitude.shape)

    def beside_event(self, angles: FloatArray) -> FloatArray:
        """Energy that the healthy pattern and one event together leave, for each angle."""
        (places, _), left = self._events(angles), np.zeros(len(angles))
        for (band, old, value, _), waves in zip(self.bands, self._waves, strict=True):
            # seen from the event
            own = value * np.exp(2j * np.pi * np.outer(places, band))[:, None]
            healthy = old * np.exp(2j * np.pi * np.outer(places + angles, band))[:, None]
            own, healthy = own - along(waves, own), healthy - along(waves, healthy)
            match = np.abs(np.sum(healthy.conj() * own, axis=2)) ** 2
            power = np.sum(np.abs(healthy) ** 2, axis=2)
            match /= np.maximum(power, np.finfo(float).tiny)
            left += np.sum(np.sum(np.abs(own) ** 2, axis=2) - match, axis=1)
        return left - self.by_mesh(angles)

    def likely_angles(self) -> FloatArray:
        """Angles [turns] at which the healthy pattern explains most of the new one, best first."""
        # eight steps per cycle of the highest line: the best angle is met within 3 per cent of
        # power
        steps = 1 << int(np.ceil(np.log2(8 * (self.new.top + 1))))
        explained = self.by_mesh(np.arange(steps) / steps)
        # what all bands explain has the transform of the sum of their autocorrelations
        lags = np.zeros(self.new.top + 1, dtype=complex)
        for band, old, value, _ in self.bands:
            span = int(band[-1] - band[0]) + 1
            product = np.zeros((len(old), span), dtype=complex)
            product[:, band - band[0]] = old.conj() * value
            power = np.maximum(np.sum(np.abs(old) ** 2, axis=1), np.finfo(float).tiny)
            match = np.abs(np.fft.fft(product, 2 * span)) ** 2 / power[:, None]
            lags[:span] += np.fft.ifft(match.sum(axis=0))[:span]
        explained += np.fft.hfft(lags, steps)
        angles, apart = [], max(1, int(_APART * steps / self.teeth))
        for _ in range(_ANGLES):
            best = int(np.argmax(explained))
            angles.append(best / steps)
            explained[np.arange(best - apart, best + apart + 1) % steps] = -np.inf
        return np.array(angles)


def spanned(columns: ComplexArray) -> tuple[ComplexArray, int]:
    """Return orthonormal columns of what columns span, 0 beyond their rank, and how many these are.

    Parameters
    ----------
    columns : ndarray of complex, shape (channels, lines, columns)
    """
    side, size, _ = np.linalg.svd(columns, full_matrices=False)
    kept = size > _RANK * size[:, :1]
    return side * kept[:, None], int(np.count_nonzero(kept))


def along(columns: ComplexArray, lines: ComplexArray) -> ComplexArray:
    """Return the part of lines that orthonormal columns span, channel by channel."""
    parts = columns.conj().swapaxes(1, 2) @ lines[..., None]
    return np.asarray((columns @ parts)[..., 0])


def turned_alike(wheels: Sequence[WheelPattern], *, same_zero: bool) -> tuple[GearPattern, ...]:
    """Turn the patterns of one gear in several healthy recordings to the angle of the first.

    Parameters
    ----------
    wheels : sequence of WheelPattern
        The same gear in each, in the same channels.
    same_zero : bool
        Whether they have the same angle zero already.
    """
    top = min(int(wheel.number.max(initial=0)) for wheel in wheels)
    found: list[GearPattern] = []
    for wheel in wheels:
        pattern = GearPattern.of(wheel, top)
        if found and not same_zero:
            # the mean of those that are turned already: it is surer than any one
            mean = GearPattern.combined(found, np.full(len(found), 1.0 / len(found)), top)
            pattern, _ = pattern.turned_to(mean, wheel.teeth)
        found.append(pattern.modulated_as(found[0], wheel.teeth) if found else pattern)
    return tuple(found)
