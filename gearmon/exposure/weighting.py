"""Frequency weightings of human vibration by ISO 8041-1, as responses and as digital filters.

A weighting is a cascade: band limits of two poles each, a transition from acceleration to velocity
and a step upwards. The digital filter has the analogue poles and zeros matched, z = exp(s T), and
eight taps that are fitted to what is then left of the analogue response, up to half the sampling
rate, in amplitude and phase but for a delay of some 3.5 samples. The delay is chosen so that the
phase at half the rate is one that a real filter can have: without that the fit fails there.

References
----------
ISO 8041-1:2017, tables 1 and 3 to 5; their parameters are printed in the reference manual of the
Larson Davis HVM200 (table 3.1), those of Wk, Wd and Wh in ISO 2631-1 and ISO 5349-1 as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_range, check_word
from gearmon.result import Result

#: Half a third-octave band upwards.
HALF_BAND = 10**0.05
#: Taps of the fit: eight leave 2.5 % at 200 Hz for the whole body, 0.2 % from
#: 500 Hz and 0.1 % from 1 kHz on; six would leave 3.3 %, 0.6 % and 0.2 %.
TAPS = 8
# Points of the fit on a straight and on a logarithmic scale. Above the band its weight falls with
# the cube of frequency, no lower than this: near half the rate the tolerance still wants +26 %.
_POINTS, _LEAST_WEIGHT = 200, 0.02


@dataclass(frozen=True, kw_only=True)
class Weighting(Result):
    """A frequency weighting.

    Parameters
    ----------
    name : str
        "Wk" and so on.
    band_hz : tuple of float
        Nominal frequency range: centres of its lowest and highest third octave [Hz].
    limits_hz : tuple of float
        f1 and f2 of the band limits, Q = 1/sqrt 2 [Hz].
    transition : tuple of float
        f3, f4 [Hz] and Q4, f3 infinite where there is no zero; empty without a transition.
    step : tuple of float
        f5 [Hz], Q5, f6 [Hz] and Q6; empty without a step.
    """

    name: str
    band_hz: tuple[float, float]
    limits_hz: tuple[float, float]
    transition: tuple[float, ...] = ()
    step: tuple[float, ...] = ()

    @property
    def tolerances_hz(self) -> tuple[float, float, float, float]:
        """Frequencies between which the tolerances hold: one and three third octaves off [Hz]."""
        low, high = (round(10 * math.log10(edge)) / 10 for edge in self.band_hz)
        return 10 ** (low - 0.3), 10 ** (low + 0.1), 10 ** (high - 0.1), 10 ** (high + 0.3)

    @property
    def least_rate_hz(self) -> float:
        """Lowest sampling rate: half of it is the upper edge of the highest third octave [Hz]."""
        return 2 * HALF_BAND * self.band_hz[1]

    def response(self, frequency_hz: ArrayLike) -> ComplexArray:
        """Return the analogue response, of the shape of the frequencies.

        Parameters
        ----------
        frequency_hz : array_like of float, >= 0
            [Hz].

        Examples
        --------
        >>> round(float(abs(frequency_weighting("Wk").response(10**0.6))), 4)
        0.9648
        """
        s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)
        sections = [np.polyval(b, s) / np.polyval(a, s) for b, a in self._polynomials()]
        return np.asarray(np.prod(sections, axis=0))

    def sections(self, sampling_rate_hz: float) -> FloatArray:
        """Return the digital filter as second-order sections for `scipy.signal.sosfilt`.

        Parameters
        ----------
        sampling_rate_hz : float, >= least_rate_hz

        Returns
        -------
        ndarray of float, shape (sections, 6)
            Its gain is 0 for a constant.

        Raises
        ------
        ArgumentError
            If the rate is lower than the weighting needs.
        """
        check_range("sampling_rate_hz", sampling_rate_hz, 1e-3, 1e10, "Hz")
        if sampling_rate_hz < self.least_rate_hz:
            raise ArgumentError(
                f"sampling rate {sampling_rate_hz:.6g} Hz: {self.name} counts vibration up to "
                f"{self.band_hz[1]:g} Hz and needs {self.least_rate_hz:.4g} Hz at least; record "
                "faster"
            )
        return _sections(self, float(sampling_rate_hz)).copy()

    def error(self, sampling_rate_hz: float) -> float:
        """Return the largest relative error of the filter's gain over the nominal range."""
        from scipy.signal import sosfreqz

        low, high = self.band_hz[0] / HALF_BAND, self.band_hz[1] * HALF_BAND
        frequency = np.geomspace(low, min(high, 0.5 * sampling_rate_hz), 500)
        sections = self.sections(sampling_rate_hz)
        _, found = sosfreqz(sections, 2 * np.pi * frequency / sampling_rate_hz)
        return float(np.abs(np.abs(found / self.response(frequency)) - 1).max())

    def _polynomials(self) -> list[tuple[list[float], list[float]]]:
        """Numerators and denominators in s of the factors, highest power first."""
        low, high = (2 * math.pi * f for f in self.limits_hz)
        root = math.sqrt(2)
        found = [([1.0, 0.0, 0.0], [1.0, root * low, low**2])]
        found += [([high**2], [1.0, root * high, high**2])]
        if self.transition:
            zero, pole, q4 = self.transition
            w3, w4 = 2 * math.pi * zero, 2 * math.pi * pole
            found += [([1 / w3, 1.0], [1 / w4**2, 1 / (q4 * w4), 1.0])]  # 1 / inf: no zero
        if self.step:
            f5, q5, f6, q6 = self.step
            w5, w6, gain = 2 * math.pi * f5, 2 * math.pi * f6, (f5 / f6) ** 2
            above = [gain / w5**2, gain / (q5 * w5), gain]
            found += [(above, [1 / w6**2, 1 / (q6 * w6), 1.0])]
        return found


@lru_cache(maxsize=64)
def _sections(weighting: Weighting, rate: float) -> FloatArray:
    """Match poles and zeros, fit taps to what is left, and pair all of them."""
    from scipy.signal import zpk2sos

    polynomials = weighting._polynomials()
    zeros = np.exp(np.concatenate([np.roots(b) for b, _ in polynomials]) / rate)
    poles = np.exp(np.concatenate([np.roots(a) for _, a in polynomials]) / rate)
    low = min(weighting.limits_hz[0] / 4, 0.01 * rate)
    scales = np.geomspace(low, 0.5 * rate, _POINTS), np.linspace(low, 0.5 * rate, _POINTS)
    frequency = np.unique(scales)
    turn = np.exp(-2j * np.pi * frequency / rate)
    matched = np.prod(1 - np.multiply.outer(turn, zeros), axis=1)
    left = weighting.response(frequency) * np.prod(1 - np.multiply.outer(turn, poles), axis=1)
    left /= matched
    half_turns = float(np.angle(left[-1])) / math.pi
    delay = half_turns + round(0.5 * (TAPS - 1) - half_turns)
    edge = HALF_BAND * weighting.band_hz[1]
    weight = np.clip((edge / frequency) ** 3, _LEAST_WEIGHT, 1.0)
    wanted = left * np.exp(-2j * np.pi * frequency / rate * delay)
    rows = turn[:, None] ** np.arange(TAPS) * (weight / wanted)[:, None]
    equations = np.concatenate([rows.real, rows.imag])
    taps = np.linalg.lstsq(equations, np.concatenate([weight, 0 * weight]), rcond=None)[0]
    return np.asarray(zpk2sos(np.concatenate([zeros, np.roots(taps)]), poles, taps[0]))


_BODY = (0.5, 80.0), (0.4, 100.0)
_M, _H = 1 / (0.028 * 2 * math.pi), 100 / (2 * math.pi)
#: All weightings by their names: nominal range, band limits, transition, step.
WEIGHTINGS = {
    name: Weighting(name=name, band_hz=band, limits_hz=limits, transition=transition, step=step)
    for name, (band, limits), transition, step in (
        ("Wk", _BODY, (12.5, 12.5, 0.63), (2.37, 0.91, 3.35, 0.91)),
        ("Wd", _BODY, (2.0, 2.0, 0.63), ()),
        ("Wc", _BODY, (8.0, 8.0, 0.63), ()),
        ("We", _BODY, (1.0, 1.0, 0.63), ()),
        ("Wj", _BODY, (), (3.75, 0.91, 5.32, 0.91)),
        ("Wm", ((1.0, 80.0), (10**-0.1, 100.0)), (_M, _M, 0.5), ()),
        ("Wh", ((8.0, 1000.0), (10**0.8, 10**3.1)), (_H, _H, 0.64), ()),
        ("Wf", ((0.1, 0.5), (0.08, 0.63)), (math.inf, 0.25, 0.86), (0.0625, 0.80, 0.10, 0.80)),
    )
}


def frequency_weighting(name: str) -> Weighting:
    """Return a weighting by its name.

    Parameters
    ----------
    name : {"Wk", "Wd", "Wc", "We", "Wj", "Wm", "Wh", "Wf"}
        Whole body: seat surface upwards, seat surface level, backrest, rotation, head of a person
        who lies, buildings; hand and arm; motion sickness.

    Returns
    -------
    Weighting

    Raises
    ------
    ArgumentError
        If there is no such weighting.

    Examples
    --------
    >>> vertical = gearmon.frequency_weighting("Wk")
    >>> np.abs(vertical.response(np.array([1.0, 6.3, 100.0]))).round(2)
    array([0.48, 1.05, 0.09])
    """
    check_word("weighting=", name, WEIGHTINGS)
    return WEIGHTINGS[name]
