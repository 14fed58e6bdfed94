"""Spectra of signals against time: calibrated lines and densities, modulation and impacts.

>>> import numpy as np
>>> from gearmon.signals.spectra import amplitude_spectrum
>>> time_s = np.arange(1000) / 1000
>>> found = amplitude_spectrum(3.0 * np.sin(2 * np.pi * 50 * time_s), 1000.0)
>>> found.values[0, 50].round(6), found.frequency_hz[50]
(np.float64(3.0), np.float64(50.0))
"""

from gearmon.lazy import lazily

_OFFERED = {
    "demodulation": ("band_envelope", "envelope_spectrum", "kurtogram"),
    "spectrum": ("Spectrum", "amplitude_spectrum", "line_amplitude", "power_density", "window"),
}

__all__ = sorted(name for names in _OFFERED.values() for name in names)
__getattr__ = lazily(__name__, _OFFERED)
