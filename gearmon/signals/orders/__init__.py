"""From samples to orders: everything that is read at angles of a shaft.

Two ways lead there, both in `resampling`. Signals are read between their samples at equal steps of
angle for waveforms, maps and synchronous averages, which must show what was recorded; samples are
spread onto steps of angle for transforms at given orders, on which `lines` (a short-time order
transform) and the fine ones of `spectra` build. All work block by block.

>>> import numpy as np
>>> from gearmon.signals.angle import AngleTrack
>>> from gearmon.signals.orders import OrderBlocks
>>> turns = 10.0 * np.arange(8000) / 1000
>>> track = AngleTrack(
...     time_s=np.array([0.0, 8.0]), turns=np.array([0.0, 80.0]), method="tacho",
...     uncertainty_turns=0.0,
... )
>>> samples = 3.0 * np.cos(2 * np.pi * 12 * turns)[None]
>>> lines = OrderBlocks(samples, 1000.0, track, np.array([12.0]), block_turns=10).lines()
>>> np.abs(lines.mean).round(3)
array([[3.]])
"""

from gearmon.lazy import lazily

_OFFERED = {
    "lines": ("OrderBlocks", "OrderLines", "OrderSums", "variance_of_mean", "without_knocks"),
    "resampling": (
        *("AngleGrid", "InAngle", "angular_waveform", "one_turn", "resample_to_angle"),
        "time_synchronous_average",
    ),
    "spectra": ("OrderMap", "clear_peaks", "fine_order_spectrum", "fine_spectrum", "order_map"),
}

__all__, __getattr__ = lazily(__name__, _OFFERED)
