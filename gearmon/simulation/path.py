"""From the mesh forces to the sensors: the housing, and all that is not gears.

Each sensor hears each stage through modes of the housing that no one knows beforehand; they are
drawn at random and belong to the machine. Rotating shafts, rolling bearings, the mains and noise
are added.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.simulation.settings import stream

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Modes of the housing, their band [Hz] and their damping ratios.
MODES = 16
MODE_BAND_HZ = (200.0, 10_000.0)
MODE_DAMPING = (0.015, 0.05)
#: Band of the frequencies of gears on their shafts and bearings [Hz], and their damping ratio.
BEARING_BAND_HZ = (1_000.0, 3_000.0)
BEARING_DAMPING = 0.1
#: Mass of the housing over that of the gears.
HOUSING_OVER_GEARS = 8.0
#: Permissible residual unbalance, eccentricity times circular speed [m/s]: ISO 21940 grade G 6.3.
UNBALANCE_MS = 6.3e-3
#: Rotor over housing mass.
ROTOR_SHARE = 0.1
#: Shaft harmonics that unbalance and misalignment make, and their sizes.
SHAFT_HARMONICS = ((1, 1.0), (2, 0.4))
#: Rolling bearings slip: their lines stand this share below the kinematic ones.
BEARING_SLIP = 0.01
#: Corner of the coloured noise over the sampling rate.
NOISE_CORNER = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalPath:
    """Accelerance from the stages to the sensors, as modes of the housing.

    Parameters
    ----------
    frequencies_hz, damping_ratios : ndarray, shape (modes,)
    sensor_shapes : ndarray, shape (channels, modes)
    stage_shapes : ndarray, shape (stages, modes)
        Mode shapes at the sensors and at the bearings of the stages; together the modes are as
        heavy as the housing.
    bearing_hz : ndarray, shape (stages,)
        Frequency of the gears of each stage on their shafts and bearings; faster forces do not
        reach the housing.
    housing_mass_kg : float
        Modal mass of every mode.
    """

    frequencies_hz: FloatArray
    damping_ratios: FloatArray
    sensor_shapes: FloatArray
    stage_shapes: FloatArray
    bearing_hz: FloatArray
    housing_mass_kg: float

    def accelerance(self, frequency_hz: FloatArray, channel: int, stage: int) -> ComplexArray:
        """Return acceleration over mesh force [1/kg] at the given frequencies, shape (n,)."""
        total = np.zeros(len(frequency_hz), dtype=np.complex128)
        weights = self.sensor_shapes[channel] * self.stage_shapes[stage]
        for own_hz, damping, weight in zip(
            self.frequencies_hz, self.damping_ratios, weights, strict=True
        ):
            total -= weight / _resonance(frequency_hz, own_hz, damping)
        total *= frequency_hz * frequency_hz / self.housing_mass_kg
        bearing_hz = float(self.bearing_hz[stage])
        total *= bearing_hz**2 / _resonance(frequency_hz, bearing_hz, BEARING_DAMPING)
        return total

    def decay_s(self) -> float:
        """Time in which the slowest mode falls to 1e-5 [s]."""
        slowest = float((self.damping_ratios * self.frequencies_hz).min())
        return math.log(1e5) / (2 * math.pi * slowest)


def _resonance(frequency_hz: FloatArray, own_hz: float, damping: float) -> ComplexArray:
    """Return f0^2 - f^2 + 2 i zeta f0 f."""
    denominator = np.empty(len(frequency_hz), dtype=np.complex128)
    denominator.real = own_hz * own_hz - frequency_hz * frequency_hz
    denominator.imag = 2 * damping * own_hz * frequency_hz
    return denominator


def random_path(seed: int, channels: int, stages: int, gear_mass_kg: float) -> ModalPath:
    """Draw the path of a machine.

    Parameters
    ----------
    seed : int
    channels, stages : int
    gear_mass_kg : float
        Mass of all gears; it sets that of the housing.
    """
    modes = stream(seed, "modes")
    low, high = np.log(MODE_BAND_HZ)
    place = (np.arange(MODES) + modes.random(MODES)) / MODES
    sensors = [stream(seed, "sensor", channel) for channel in range(channels)]
    bearings = [stream(seed, "bearing", stage) for stage in range(stages)]
    return ModalPath(
        frequencies_hz=np.exp(low + (high - low) * place),
        damping_ratios=modes.uniform(*MODE_DAMPING, MODES),
        sensor_shapes=np.array([g.normal(size=MODES) for g in sensors]) / math.sqrt(MODES),
        stage_shapes=np.array([g.normal(size=MODES) for g in bearings]),
        bearing_hz=np.array([np.exp(g.uniform(*np.log(BEARING_BAND_HZ))) for g in bearings]),
        housing_mass_kg=HOUSING_OVER_GEARS * gear_mass_kg,
    )


def through_path(
    path: ModalPath, spectra: ComplexArray, samples: int, rate_hz: float
) -> FloatArray:
    """Return the accelerations [m/s2] at the sensors for spectra of stage forces.

    Parameters
    ----------
    path : ModalPath
    spectra : ndarray of complex, shape (stages, samples // 2 + 1)
        Real transforms of the stage forces [N] sampled at `rate_hz`.
    samples : int
    rate_hz : float

    Returns
    -------
    ndarray, shape (channels, samples)
    """
    frequency = np.asarray(np.fft.rfftfreq(samples, 1 / rate_hz), dtype=np.float64)
    rows = []
    for channel in range(len(path.sensor_shapes)):
        total = np.zeros(len(frequency), dtype=np.complex128)
        for stage, spectrum in enumerate(spectra):
            total += path.accelerance(frequency, channel, stage) * spectrum
        rows.append(np.fft.irfft(total, samples))
    return np.array(rows)


def shaft_lines(
    seed: int, orders: list[float], turns: FloatArray, speed_hz: FloatArray, channels: int
) -> FloatArray:
    """Return the accelerations [m/s2] that unbalance and misalignment of the shafts make.

    Parameters
    ----------
    seed : int
    orders : list of float
        Turns of each shaft per turn of shaft 1.
    turns, speed_hz : ndarray, shape (samples,)
        Angle [turns] and speed [Hz] of shaft 1.
    channels : int

    Returns
    -------
    ndarray, shape (channels, samples)

    Notes
    -----
    A rotor of mass m with the permissible unbalance e w = 6.3 mm/s pulls with m e w^2.
    """
    total = np.zeros((channels, len(turns)))
    for shaft, order in enumerate(orders, start=1):
        generators = [stream(seed, "unbalance", shaft, channel) for channel in range(channels)]
        force = ROTOR_SHARE * UNBALANCE_MS * 2 * math.pi * order * speed_hz
        for harmonic, size in SHAFT_HARMONICS:
            angle = 2 * math.pi * harmonic * order * turns
            cosine, sine = force * np.cos(angle), force * np.sin(angle)
            for row, generator in zip(total, generators, strict=True):
                gain = size * generator.normal(size=2)
                row += gain[0] * cosine + gain[1] * sine
    return total


def tones(
    seed: int, orders: list[float], turns: FloatArray, amplitude: FloatArray, harmonics: int
) -> FloatArray:
    """Return lines at orders of shaft 1 and their harmonics, of random phase.

    Parameters
    ----------
    seed : int
    orders : list of float
    turns : ndarray, shape (samples,)
        Angle of shaft 1 [turns].
    amplitude : ndarray, shape (channels,)
        Amplitude of the first harmonic of each line [m/s2]; the others fall as 1/n.
    harmonics : int

    Returns
    -------
    ndarray, shape (channels, samples)
    """
    total = np.zeros((len(amplitude), len(turns)))
    for line, order in enumerate(orders):
        for harmonic in range(1, harmonics + 1):
            phase = stream(seed, "tone", line, harmonic).uniform(0, 2 * math.pi)
            wave = np.cos(2 * math.pi * order * harmonic * turns + phase) / harmonic
            total += amplitude[:, None] * wave
    return total


def noise(generator: np.random.Generator, samples: int, deviation: float) -> FloatArray:
    """Return noise, half of its power white and half coloured, with the given rms.

    Parameters
    ----------
    generator : numpy.random.Generator
    samples : int
    deviation : float
        rms of the sum [same unit as the result].

    Notes
    -----
    The coloured part is first-order low-pass noise with its corner at 2 % of the sampling rate.
    """
    white = generator.normal(size=samples)
    spectrum = np.fft.rfft(generator.normal(size=samples))
    spectrum /= 1 + 1j * np.fft.rfftfreq(samples) / NOISE_CORNER
    spectrum[0] = 0.0
    coloured = np.fft.irfft(spectrum, samples)
    coloured /= max(float(np.sqrt(np.mean(coloured**2))), 1e-300)
    return deviation * math.sqrt(0.5) * (white + coloured)


def tacho_pulses(
    turns: FloatArray, rate_hz: float, speed_hz: FloatArray, high: float, width: float
) -> FloatArray:
    """Return the voltage of a tacho with one pulse per turn.

    Parameters
    ----------
    turns : ndarray, shape (samples,)
        Angle of its shaft [turns]; a pulse begins at every whole turn.
    rate_hz : float
        Sampling rate [Hz].
    speed_hz : ndarray, shape (samples,)
        Speed of its shaft [Hz].
    high : float
        Voltage of the pulse [V]; 0 V in between.
    width : float
        Length of the pulse [turns].

    Returns
    -------
    ndarray, shape (samples,)

    Notes
    -----
    The flanks last two samples and cross half of `high` at the true angle, so that the instant can
    be found between samples.
    """
    samples_away = rate_hz / speed_hz
    place = turns - np.floor(turns)
    # counted from the nearest pulse, so that a flank may begin before the whole turn
    place = np.where(place > 0.5 + 0.5 * width, place - 1, place)
    rise = np.clip(0.5 + 0.5 * place * samples_away, 0, 1)
    fall = np.clip(0.5 + 0.5 * (place - width) * samples_away, 0, 1)
    return high * (rise - fall)
