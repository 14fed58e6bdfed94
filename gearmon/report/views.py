"""What a picture shows, as plain arrays and words: the step between results and drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class LineMark:
    """A place on a frequency axis where the machine puts, or should put, a line.

    Parameters
    ----------
    frequency_hz : float
        Place [Hz].
    label : str
        Short text ("GMF1 ×2", "+3"); "" for none.
    series : int
        Which colour and marker, from 0.
    amplitude : float or None
        Measured peak amplitude of the line, None if it is not heard or was not measured.
    half_width_hz : float
        Half of the range in which it was looked for [Hz], 0 if the place is known.
    """

    frequency_hz: float
    label: str
    series: int
    amplitude: float | None = None
    half_width_hz: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectrumView:
    """Amplitude spectrum of one channel with the machine's lines.

    Parameters
    ----------
    channel : str
        Channel.
    unit : str
        Unit of the amplitude, in words for the axis.
    axis : str
        What the frequency axis shows.
    frequency_hz, amplitude : ndarray of float, shape (points,)
        The spectrum, thinned by max-hold; amplitudes are peak values.
    meshes : tuple of LineMark
        Mesh harmonics.
    sidebands : tuple of LineMark
        Sidebands, in a close-up.
    legend : tuple of (str, int)
        Name and series of each kind of sideband.
    """

    channel: str
    unit: str
    axis: str
    frequency_hz: FloatArray
    amplitude: FloatArray
    meshes: tuple[LineMark, ...]
    sidebands: tuple[LineMark, ...] = ()
    legend: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, kw_only=True)
class FamilyGroup:
    """Families that differ only in the mesh harmonic, in a row of a picture.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    label : str
        The group in one or two lines.
    harmonics : tuple of int
        Mesh harmonics, ascending.
    columns : tuple of int
        Position of each in the arrays of the view.
    """

    stage: int
    label: str
    harmonics: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelsView:
    """Levels of all families in one channel against the healthy recordings.

    Parameters
    ----------
    channel : str
        Channel.
    unit : str
        Unit of the signal.
    groups : tuple of FamilyGroup
        Order and labels of the families.
    measured_db : ndarray of float, shape (families,)
        Measured level [dB re 1 unit^2].
    low_db, high_db : ndarray of float, shape (families,)
        Range of the healthy recordings [dB]; NaN without a reference.
    expected_db, scatter_db : ndarray of float, shape (families,)
        Level of the healthy machine at this load and its standard deviation [dB], or NaN.
    beyond : ndarray of bool, shape (families,)
        Whether the change exceeds `BEYOND` standard deviations.
    """

    channel: str
    unit: str
    groups: tuple[FamilyGroup, ...]
    measured_db: FloatArray
    low_db: FloatArray
    high_db: FloatArray
    expected_db: FloatArray
    scatter_db: FloatArray
    beyond: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ChangesView:
    """Changes of one stage: groups of families in rows, mesh harmonics of each channel in columns.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    rows : tuple of str
        Labels of the groups.
    channels : tuple of str
        Labels of the blocks of columns.
    harmonics : tuple of int
        Mesh harmonics in every block.
    change_db : ndarray of float, shape (rows, channels, harmonics)
        Change [dB], NaN where there is no such family.
    beyond : ndarray of bool, same shape
        Whether the change exceeds `BEYOND` standard deviations.
    limit_db : float
        End of the colour scale [dB].
    """

    stage: int
    rows: tuple[str, ...]
    channels: tuple[str, ...]
    harmonics: tuple[int, ...]
    change_db: FloatArray
    beyond: BoolArray
    limit_db: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PatternView:
    """Mesh harmonics of one stage relative to the strongest, expected and measured.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    harmonics : ndarray of int, shape (harmonics,)
        Mesh harmonics.
    frequency_hz : ndarray of float, shape (harmonics,)
        Their frequencies [Hz].
    expected_db : ndarray of float, shape (harmonics,)
        Expected acceleration of the mesh relative to its strongest harmonic [dB].
    channels : tuple of str
        Channels.
    measured_db : ndarray of float, shape (channels, harmonics)
        Measured level relative to the channel's strongest [dB]; NaN where not heard.
    """

    stage: int
    harmonics: NDArray[np.int64]
    frequency_hz: FloatArray
    expected_db: FloatArray
    channels: tuple[str, ...]
    measured_db: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnView:
    """Synchronous average of one channel over one turn of a gear.

    Parameters
    ----------
    channel, unit : str
        Channel and unit of the signal.
    teeth : int
        Teeth of the gear.
    tooth : ndarray of float, shape (points,)
        Place in the turn as a tooth number: j in the middle of the contact of tooth j.
    average : ndarray of float, shape (points,)
        Synchronous average.
    rest : ndarray of float, shape (points,)
        The same without the mesh harmonics.
    flagged : float or None
        Place of a flagged tooth.
    """

    channel: str
    unit: str
    teeth: int
    tooth: FloatArray
    average: FloatArray
    rest: FloatArray
    flagged: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class TeethView:
    """Energy of the departure by tooth.

    Parameters
    ----------
    energy : ndarray of float, shape (teeth,)
        Energy over windows of two teeth, median 1.
    number : ndarray of float, shape (teeth,)
        Where in the turn each energy was taken, as a tooth number.
    place : float
        Where in the turn the energy is highest, as a tooth number.
    ratio : float
        Highest energy over the median.
    flagged : bool
        Whether that is flagged.
    numbered : bool
        Whether the numbers hold for other recordings too.
    against : str
        What was compared with.
    """

    energy: FloatArray
    number: FloatArray
    place: float
    ratio: float
    flagged: bool
    numbered: bool
    against: str


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedView:
    """Speed of shaft 1 over time.

    Parameters
    ----------
    time_s, speed_hz : ndarray of float, shape (points,)
        Speed against time.
    mean_hz, uncertainty_hz, nominal_hz : float
        Mean, its standard deviation, and the nominal speed [Hz].
    method : str
        How it was found.
    """

    time_s: FloatArray
    speed_hz: FloatArray
    mean_hz: float
    uncertainty_hz: float
    nominal_hz: float
    method: str
