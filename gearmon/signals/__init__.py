"""Vibration signals in general: recordings, spectra, angle; knows no gears."""
