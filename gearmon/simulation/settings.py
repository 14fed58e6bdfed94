"""What a simulated recording is to be like."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np

from gearmon.errors import ArgumentError, check_range
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint
from gearmon.machine.fields import Checked, Count, held, within

#: Sampling rate over mesh frequency that anti-aliasing needs to let the mesh through.
LEAST_RATE_OVER_MESH = 2.56
#: Most samples in a channel.
MOST_SAMPLES = 100_000_000
LARGEST_SEED = 2**64
_POSITIVE = {"open_low": True, "open_high": True}


def stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the generator of one purpose.

    Parameters
    ----------
    seed : int, >= 0
    *purpose : str or int
        What the numbers are for, such as ``"pitch", 1, "pinion"``.

    Examples
    --------
    >>> one, two = stream(7, "noise", 1), stream(7, "noise", 1)
    >>> bool(one.random() == two.random())
    True
    """
    name = "/".join(str(part) for part in purpose).encode()
    return np.random.default_rng([seed, zlib.crc32(name)])


@dataclass(frozen=True, kw_only=True)
class Settings(Checked):
    """What a simulated recording is to be like.

    Parameters
    ----------
    duration_s : float, > 0
        Length [s].
    sampling_rate_hz : float, > 0
        [Hz].
    machine_seed : int, >= 0
        Of all that belongs to the machine: pitch errors, eccentricities, path to the sensors.
    recording_seed : int, >= 0
        Of all that differs between its recordings: wander of speed and load, start angle, noise.
    channels : int, 1 to 64
        Number of accelerometers.
    load : float, in (0, 10]
        Mean load, as a share of the torque of the operating point.
    slip : float, in [-0.2, 0.2]
        Share by which the machine runs slower than its nominal speed.
    speed_drift, load_drift : float, in [0, 0.1]
        Standard deviations of the slow wander of speed and of load, as shares of their means.
    torque_ripple : float, in [0, 0.5]
        Largest amplitude of the torque that varies with each turn of each shaft, as a share.
    snr_db : float or None
        Power of the vibration over that of the noise in each channel [dB]; None for no noise.
    accuracy_grade : float, 1 to 11, or None
        Flank tolerance class of ISO 1328-1 of all gears; None for perfect gears.
    unbalance : float, >= 0
        Shaft lines, as a multiple of those at the permissible unbalance G 6.3.
    bearing_tones : float, >= 0
        Amplitude of the lines of the machine's rolling bearings over the rms of the vibration.
    mains_hz : float, optional
        Mains frequency whose double is heard, at a tenth of the rms of the vibration.
    tacho_shaft : int, optional
        Shaft that gives a tacho pulse per turn, in a column of its own.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    duration_s: float = within(0, math.inf, "s", default=10.0, **_POSITIVE)
    sampling_rate_hz: float = within(0, math.inf, "Hz", default=20_000.0, **_POSITIVE)
    machine_seed: int = held(Count(low=0, high=LARGEST_SEED), 0)
    recording_seed: int = held(Count(low=0, high=LARGEST_SEED), 0)
    channels: int = held(Count(low=1, high=64), 4)
    load: float = within(0, 10, default=1.0, open_low=True)
    slip: float = within(-0.2, 0.2, default=0.01)
    speed_drift: float = within(0, 0.1, default=0.005)
    load_drift: float = within(0, 0.1, default=0.03)
    torque_ripple: float = within(0, 0.5, default=0.02)
    snr_db: float | None = 20.0
    accuracy_grade: float | None = 6.0
    unbalance: float = within(0, 1000, default=1.0)
    bearing_tones: float = within(0, 1000, default=0.0)
    mains_hz: float | None = within(0, math.inf, "Hz", default=None, **_POSITIVE)
    tacho_shaft: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.duration_s * self.sampling_rate_hz > MOST_SAMPLES:
            raise ArgumentError(
                f"duration_s={self.duration_s:g} s makes more than {MOST_SAMPLES} samples at "
                f"{self.sampling_rate_hz:g} Hz; take less of either"
            )
        if self.snr_db is not None:
            check_range("snr_db", self.snr_db, -60, 200, "dB")
        if self.accuracy_grade is not None:
            check_range("accuracy_grade", self.accuracy_grade, 1, 11)

    @property
    def samples(self) -> int:
        """Samples in each channel."""
        return round(self.duration_s * self.sampling_rate_hz)

    def mean_shaft1_hz(self, point: OperatingPoint) -> float:
        """Speed about which shaft 1 wanders [Hz]."""
        return point.shaft1_hz * (1.0 - self.slip)

    def check_against(self, machine: Machine, point: OperatingPoint) -> None:
        """Refuse what this machine cannot be recorded with.

        Parameters
        ----------
        machine : Machine
            What is to be recorded.
        point : OperatingPoint
            How it runs.

        Raises
        ------
        ArgumentError
            If the recording is shorter than one turn of the slowest shaft, its rate too low for a
            mesh, a wanted line above half the rate, or the tacho's shaft does not exist.
        """
        train, speed = kinematics(machine), self.mean_shaft1_hz(point)
        slowest = min(train.shafts, key=lambda shaft: shaft.order)
        turn_s = 1 / (slowest.order * speed)
        if self.duration_s < turn_s:
            raise ArgumentError(
                f"duration_s={self.duration_s:g} s is less than one turn of shaft "
                f"{slowest.number}, {turn_s:.4g} s; take at least that"
            )
        fastest = max(train.meshes, key=lambda mesh: mesh.order)
        least_hz = LEAST_RATE_OVER_MESH * fastest.order * speed
        if self.sampling_rate_hz < least_hz:
            raise ArgumentError(
                f"sampling_rate_hz={self.sampling_rate_hz:g} Hz is too low for the mesh of stage "
                f"{fastest.stage} at {fastest.order * speed:.4g} Hz; take at least "
                f"{math.ceil(least_hz)} Hz"
            )
        if self.mains_hz is not None and 2 * self.mains_hz > 0.4 * self.sampling_rate_hz:
            raise ArgumentError(
                f"mains_hz={self.mains_hz:g} Hz: its double must lie below 0.4 of the sampling rate"
            )
        if self.tacho_shaft is not None and self.tacho_shaft not in range(1, len(train.shafts) + 1):
            raise ArgumentError(
                f"tacho_shaft={self.tacho_shaft} must lie in [1, {len(train.shafts)}]"
            )
