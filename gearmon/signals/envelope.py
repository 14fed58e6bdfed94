"""Demodulation: complex envelope of a band, its spectrum, and the modulation of a carrier.

A band is picked out of the Fourier transform and shifted to zero, which is an ideal band-pass and
the Hilbert transform in one step: no phase lag, and the envelope comes out at the low rate that
the band needs. Ends: the record is taken as periodic, so the first and last 3/bandwidth seconds of
a record that is not are smeared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.signals.spectrum import Spectrum, hann
from gearmon.signals.transforms import batch, fast_length, quick_length, transform

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class Envelope:
    """Complex envelope of one band: signal = Re[values exp(2 pi i centre t)] within the band.

    Parameters
    ----------
    values : ndarray of complex, shape (channels, m)
        Modulus is the amplitude (peak), angle the phase against the centre.
    rate : float
        Samples per unit of time or angle.
    centre : float
        Frequency that was shifted to zero, per unit of time or angle.
    low, high : float
        Edges of the band.
    """

    values: ComplexArray
    rate: float
    centre: float
    low: float
    high: float

    @property
    def amplitude(self) -> FloatArray:
        """|values|, shape (channels, m)."""
        return np.abs(self.values)


@dataclass(frozen=True, kw_only=True)
class Modulation:
    """Amplitude and phase modulation of a carrier: X [1 + a(x)] cos(2 pi f x + phase + b(x)).

    Parameters
    ----------
    position : ndarray of float, shape (m,)
        Time or angle of the samples.
    amplitude : ndarray of float, shape (channels, m)
        a(x), relative to the mean amplitude X; mean 0.
    phase_rad : ndarray of float, shape (channels, m)
        b(x) [rad]; mean 0, slope kept (a wrong carrier frequency shows as a slope).
    carrier : ndarray of float, shape (channels,)
        X, mean of the modulus.
    """

    position: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray
    carrier: FloatArray


def band_envelope(
    samples: FloatArray, rate: float, low: float, high: float, centre: float | None = None
) -> Envelope:
    """Complex envelope of a band.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        The signals, n >= 8.
    rate : float
        Samples per unit of time or angle, > 0.
    low, high : float
        Edges of the band, 0 <= low < high <= rate/2; rounded to lines of the transform.
    centre : float, optional
        Frequency to shift to zero, within the band; its middle by default.

    Returns
    -------
    Envelope
        At a rate of at least the width of the band.

    Raises
    ------
    ArgumentError
        If the band is out of its range or holds fewer than two lines.
    """
    signals = _signals(samples, rate)
    check_range("low", low, 0.0, rate / 2)
    check_range("high", high, 0.0, rate / 2)
    samples_in, count = signals.shape[-1], quick_length(signals.shape[-1])
    first, last = round(low * count / rate), round(high * count / rate)
    last = min(last, (count - 1) // 2)
    if last - first < 2:
        raise ArgumentError(
            f"band {low:g} to {high:g} holds fewer than two lines; its width must be at least "
            f"{2 * rate / count:.3g}"
        )
    lines = (2.0 / count) * transform(signals, count)[:, first : last + 1]
    if first == 0:
        lines[:, 0] *= 0.5  # the mean has no conjugate to be folded in
    middle = (first + last) // 2 if centre is None else round(centre * count / rate)
    if not first <= middle <= last:
        raise ArgumentError(f"centre={centre} must lie within the band {low:g} to {high:g}")
    length = fast_length(2 * max(last - middle, middle - first) + 2)
    work = batch(length, 1, signals.size, inverse=True)
    # of a record that was padded the padding is left out again
    values = np.empty((len(signals), -(-length * samples_in // count)), dtype=np.complex128)
    for row in range(len(signals)):
        work.input[:] = 0.0
        work.input[0, : last - middle + 1] = lines[row, middle - first :]
        if middle > first:
            work.input[0, -(middle - first) :] = lines[row, : middle - first]
        values[row] = work.run()[0, : values.shape[-1]]
    return Envelope(
        values=values,
        rate=length * rate / count,
        centre=middle * rate / count,
        low=first * rate / count,
        high=last * rate / count,
    )


def envelope_spectrum(
    samples: FloatArray, rate: float, low: float, high: float, *, squared: bool = False
) -> Spectrum:
    """Amplitude spectrum of the envelope of a band, or of its square.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
    rate : float
        Sampling rate [Hz], or samples a turn.
    low, high : float
        Edges of the band [Hz], or orders.
    squared : bool
        Whether to take the squared envelope, whose lines add no harmonics of their own.

    Returns
    -------
    Spectrum
        Peak amplitudes in the signal's unit (squared: unit^2), Hann window, mean removed; up to the
        width of the band: a band of width B carries no modulation faster than B.

    Raises
    ------
    ArgumentError
        As `band_envelope`.
    """
    envelope = band_envelope(samples, rate, low, high)
    size = envelope.amplitude
    size = size**2 if squared else size
    size = size - size.mean(axis=-1, keepdims=True)
    count = size.shape[-1]
    window = hann(count)
    values = np.abs(np.fft.rfft(size * window, axis=-1)) * 2.0 / window.sum()
    values[:, 0] *= 0.5
    frequency = envelope.rate / count * np.arange(values.shape[-1])
    kept = frequency <= (envelope.high - envelope.low) * (1 + 1e-12)
    return Spectrum(
        frequency_hz=frequency[kept],
        values=values[:, kept],
        quantity="amplitude",
        resolution_hz=1.5 * envelope.rate / count,
    )


def demodulate(samples: FloatArray, rate: float, carrier: float, half_width: float) -> Modulation:
    """Amplitude and phase modulation of a carrier, such as a mesh harmonic of an average.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n) or (n,)
        Signals against time, or better against angle (a synchronous average is periodic, so that
        its ends are as good as its middle).
    rate : float
        Samples per unit of time or angle.
    carrier : float
        Its frequency or order.
    half_width : float
        Half the band: modulation up to this frequency or order is kept. Half the distance to the
        next mesh harmonic takes all sidebands that are not nearer to it.

    Returns
    -------
    Modulation

    Raises
    ------
    ArgumentError
        If the band reaches beyond 0 or half the rate, or the carrier is absent.

    Notes
    -----
    Amplitude and phase are those of the whole band. They mean modulation only where the carrier is
    the strongest line in it: with a carrier smaller than its sidebands the phase jumps.
    McFadden, J. Vib. Acoust. 108 (1986) 165-170.
    """
    check_positive("half_width", half_width)
    low, high = carrier - half_width, carrier + half_width
    if low < 0 or high > rate / 2:
        raise ArgumentError(
            f"band {low:g} to {high:g} about carrier={carrier:g} must lie in [0, {rate / 2:g}]; "
            "take a smaller half_width"
        )
    envelope = band_envelope(samples, rate, low, high, carrier)
    size = envelope.amplitude
    mean = size.mean(axis=-1)
    if (mean <= 0).any():
        raise ArgumentError(f"nothing vibrates about carrier={carrier:g}")
    phase = np.unwrap(np.angle(envelope.values), axis=-1)
    position = np.arange(size.shape[-1]) / envelope.rate
    # the line next to the carrier is not the carrier: its slow beat is taken off
    phase = phase - 2 * np.pi * (carrier - envelope.centre) * position
    return Modulation(
        position=position,
        amplitude=size / mean[:, None] - 1.0,
        phase_rad=phase - phase.mean(axis=-1, keepdims=True),
        carrier=mean,
    )


def _signals(samples: FloatArray, rate: float) -> FloatArray:
    check_positive("rate", rate)
    signals = np.atleast_2d(np.asarray(samples, dtype=float))
    if signals.ndim != 2 or signals.shape[-1] < 8:
        raise ArgumentError(f"samples: shape {signals.shape}, at least 8 values are needed")
    return signals
