"""Vibration in general: recordings, their spectra, the angle of a shaft, and lines at its orders.

Nothing here knows gears: orders come as plain numbers. `recording` holds the value object that all
others take, `reading` makes it of files. `spectra` looks at signals against time; `tracking` finds
speed and angle, with a tachometer or tacholess; `orders` looks at signals against that angle;
`indicators` condenses waveforms and averages to numbers. `angle` and `threads` serve them.

>>> import numpy as np
>>> from gearmon.signals.indicators import kurtosis
>>> from gearmon.signals.recording import Recording
>>> turn = 2 * np.pi * np.arange(1000) / 100
>>> recording = Recording(samples=np.sin(turn)[None], sampling_rate_hz=2000.0)
>>> kurtosis(recording.samples).round(6)
array([1.5])
"""
