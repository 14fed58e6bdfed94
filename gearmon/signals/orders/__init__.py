"""From samples to orders: everything that is read at angles of a shaft.

Two ways lead there. `resampling` reads signals between their samples at equal steps of angle, for
waveforms, maps and synchronous averages that must show what was recorded. `nonuniform_fft` spreads
samples onto steps of angle for transforms at given orders; `lines` (a short-time order transform),
`fine_spectra` and, for many angle tracks of one recording, `sums` build on it. All work block by
block.

>>> import numpy as np
>>> from gearmon.signals.angle import AngleTrack
>>> from gearmon.signals.orders import order_lines
>>> turns = 10.0 * np.arange(8000) / 1000
>>> track = AngleTrack(
...     time_s=np.array([0.0, 8.0]), turns=np.array([0.0, 80.0]), method="tacho",
...     uncertainty_turns=0.0,
... )
>>> samples = 3.0 * np.cos(2 * np.pi * 12 * turns)[None]
>>> lines = order_lines(samples, 1000.0, track, np.array([12.0]), block_turns=10)
>>> np.abs(lines.mean).round(3)
array([[3.]])
"""

from gearmon.signals.orders.averages import (
    SynchronousAverage,
    one_turn,
    time_synchronous_average,
)
from gearmon.signals.orders.fine_spectra import (
    FineSpectrum,
    clear_peaks,
    fine_envelope_spectrum,
    fine_order_spectrum,
    fine_spectrum,
)
from gearmon.signals.orders.lines import OrderLines, order_lines, variance_of_mean, without_knocks
from gearmon.signals.orders.maps import OrderMap, order_map
from gearmon.signals.orders.resampling import (
    READ_UP_TO,
    AngleGrid,
    angle_blocks,
    angular_waveform,
    resample_to_angle,
    whole_turns,
)
from gearmon.signals.orders.sums import OrderSums, SlidingLines

__all__ = [
    "READ_UP_TO",
    "AngleGrid",
    "FineSpectrum",
    "OrderLines",
    "OrderMap",
    "OrderSums",
    "SlidingLines",
    "SynchronousAverage",
    "angle_blocks",
    "angular_waveform",
    "clear_peaks",
    "fine_envelope_spectrum",
    "fine_order_spectrum",
    "fine_spectrum",
    "one_turn",
    "order_lines",
    "order_map",
    "resample_to_angle",
    "time_synchronous_average",
    "variance_of_mean",
    "whole_turns",
    "without_knocks",
]
