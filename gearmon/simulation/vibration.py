"""The vibration that the meshes make: integrated, sampled and passed to the sensors.

Each sensor hears each stage through modes of the housing that no one knows beforehand; they are
drawn at random and belong to the machine. Rotating shafts, rolling bearings, the mains and noise
are added.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.gears.kinematics import PLANET_PASS_DEPTH
from gearmon.simulation.contact import Drive, contact_course
from gearmon.simulation.integrate import SUBSTEPS, MeshForces, integrate
from gearmon.simulation.train import Settings, Train, stream
from gearmon.terminal import Progress, part_of

Floats32 = NDArray[np.float32]

#: The recording's response is flat up to this share of its sampling rate and zero from a half on.
FLAT_SHARE = 0.4

#: Steps of the integration in a period of the fastest natural frequency that the recording carries:
#: the dynamic mesh force is then right to about 3e-4 of its rms.
STEPS_PER_PERIOD = 24
#: Steps in a period of faster ones, which only have to stay stable and damped.
STEPS_PER_FAST_PERIOD = 10
#: Share of the sampling rate up to which a natural frequency counts as carried.
CARRIED_SHARE = 0.6
#: Time constants of the slowest transient in the run-in of a chunk: e^-15 = 3e-7.
RUN_IN_CONSTANTS = 15.0
#: Cells of the fine grid per sample, and per period of the fastest natural frequency.
CELLS_PER_SAMPLE, CELLS_PER_PERIOD = 8, 6
#: Steps of one mesh that are held in memory at a time, and cells whose means are taken together.
STEPS_PER_BLOCK, CELLS_PER_BLOCK = 5_000_000, 100_000
# Cosine flanks that let the record begin and end without a blow [s], beyond what is kept.
_FLANK_S = 0.02
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


def triangle_means(
    forces: MeshForces, start_s: float, cell_s: float, cells: int, before: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return means of the mesh forces with triangular weights about the beginnings of cells.

    Parameters
    ----------
    forces : MeshForces
        Over a course that covers the cells.
    start_s, cell_s : float
        Beginning of the first cell and length of a cell [s].
    cells : int
    before : ndarray, shape (meshes,), optional
        What the call for the cells before these gave as its second result; without it the first
        mean is one-sided.

    Returns
    -------
    means : ndarray, shape (meshes, cells)
        [N].
    after : ndarray, shape (meshes,)
        What the next cells need of these.

    Notes
    -----
    The weight is 1/h at the instant and falls to 0 at a cell's length h to both sides. Within a
    step the force is the parabola with the known integral and the known values at both ends.
    """
    edges = start_s + cell_s * np.arange(cells + 1, dtype=np.float64)
    rows = [forces.impulses_ns, forces.starts_n, forces.ends_n]
    # where the steps begin, and where the last one ends
    times, share = forces.course.times_s, np.arange(SUBSTEPS) / SUBSTEPS
    begins = times[:-1, None] + np.diff(times)[:, None] * share
    steps_s = np.append(begins.ravel(), times[-1])
    parts = [
        _moments(rows, steps_s, edges[first : first + CELLS_PER_BLOCK + 1])
        for first in range(0, cells, CELLS_PER_BLOCK)
    ]
    whole, earlier = np.concatenate(parts, axis=2)
    later = cell_s * whole - earlier
    first = later[:, 0] if before is None else before
    means = (later + np.column_stack([first, earlier[:, :-1]])) / cell_s**2
    return means, earlier[:, -1]


def _moments(rows: list[Floats32], steps_s: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return integrals of force and of force times time since its beginning for each cell.

    `rows` are impulses of the steps and forces at their ends. The shape is (2, meshes, cells).
    Between steps and cells both are cubics at most: two Gauss points are exact.
    """
    first, last = np.searchsorted(steps_s, [edges_s[0], edges_s[-1]])
    both = np.concatenate([edges_s, steps_s[first:last]])
    order = np.argsort(both, kind="stable")  # two sorted runs: they are only merged
    grid, new_cell = both[order], order < len(edges_s)
    real = np.flatnonzero(np.diff(grid))  # an edge may be the beginning of a step as well
    half, middle = 0.5 * np.diff(grid)[real], 0.5 * (grid[1:] + grid[:-1])[real]
    cell = np.cumsum(new_cell)[real] - 1
    step = np.clip(first - 1 + np.cumsum(~new_cell)[real], 0, len(steps_s) - 2)
    begin, length = steps_s[step], steps_s[step + 1] - steps_s[step]
    places = [middle - half / math.sqrt(3), middle + half / math.sqrt(3)]
    shares = [(place - begin) / length for place in places]
    begun = edges_s[cell]
    total = np.zeros((2, len(rows[0]), len(edges_s) - 1))
    for mesh, known in enumerate(zip(*rows, strict=True)):
        impulse, start, end = (row[step].astype(np.float64) for row in known)
        mean = impulse / length
        bend, twist = 6 * mean - 4 * start - 2 * end, 3 * (start + end - 2 * mean)
        forces = [half * (start + x * (bend + x * twist)) for x in shares]
        moments = [force * (place - begun) for force, place in zip(forces, places, strict=True)]
        total[0, mesh] = np.bincount(cell, forces[0] + forces[1])
        total[1, mesh] = np.bincount(cell, moments[0] + moments[1])
    return total


def band_spectrum(cells: FloatArray, oversampling: int) -> ComplexArray:
    """Return the spectrum of triangle means as far as a recording with fewer samples carries it.

    Parameters
    ----------
    cells : ndarray, shape (rows, samples * oversampling)
        Means with triangular weights about the beginnings of cells, real; taken as one period.
    oversampling : int
        Cells per sample of the recording.

    Returns
    -------
    ndarray of complex, shape (rows, samples // 2 + 1)
        Such that the inverse real transform gives the recording's samples, at the beginnings of
        the cells 0, oversampling, 2 oversampling ...
    """
    count = cells.shape[-1]
    kept = count // oversampling // 2 + 1
    frequency = np.arange(kept) / count
    # of the anti-aliasing filter; triangular weights roll off as sinc^2
    fall = np.clip((frequency * oversampling - FLAT_SHARE) / (0.5 - FLAT_SHARE), 0.0, 1.0)
    correction = (0.5 + 0.5 * np.cos(np.pi * fall)) / np.sinc(frequency) ** 2 / oversampling
    return np.stack([np.fft.rfft(row)[:kept] * correction for row in cells])


def fade_ends(rows: FloatArray, flank: int) -> None:
    """Let all rows begin and end in cosine flanks of `flank` samples, in place."""
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(flank) + 0.5) / flank)
    rows[:, :flank] *= rise
    rows[:, -flank:] *= rise[::-1]


class _Grid(NamedTuple):
    """Cells of a record, with a lead and a tail that are cut off at the end."""

    cells: int
    lead: int
    cell_s: float

    def edge_s(self, cell: int) -> float:
        return (cell - self.lead) * self.cell_s


def mesh_vibration(
    train: Train, drive: Drive, settings: Settings, progress: Progress | None
) -> tuple[FloatArray, dict[str, float]]:
    """Integrate the motion of a train and return what the sensors hear of its meshes.

    Parameters
    ----------
    train : Train
    drive : Drive
    settings : Settings
    progress : callable, optional
        Called now and then with the share done, 0 to 1.

    Returns
    -------
    heard : ndarray, shape (channels, samples)
        Accelerations [m/s2].
    integration : dict of str to float
        How they were computed: ``longest_step_s``, ``steps``, and ``joint_mismatch``, the largest
        disagreement where chunks join: root of its energy over that at rest.
    """
    stages = len(train.carrier_orders)
    path = random_path(settings.machine_seed, settings.channels, stages, train.gear_mass_kg)
    frequencies = train.system.natural_frequencies_hz(train.greatest_stiffness)
    rate = settings.sampling_rate_hz
    flank = math.ceil(_FLANK_S * rate) + 8
    # until the slowest mode has fallen to 1e-5
    slowest = float((path.damping_ratios * path.frequencies_hz).min())
    lead = flank + math.ceil(math.log(1e5) / (2 * math.pi * slowest) * rate)
    samples = 2 * next_fast_len(-(-(settings.samples + lead + 2 * flank) // 2), real=True)
    cells = max(CELLS_PER_SAMPLE, math.ceil(CELLS_PER_PERIOD * frequencies[-1] / rate))
    oversampling = next_fast_len(cells, real=True)
    grid = _Grid(samples * oversampling, lead * oversampling, 1 / (rate * oversampling))
    fastest_hz = float(np.abs(train.system.rates).max()) / (2 * math.pi)
    every_hz = np.append(frequencies, fastest_hz)
    carried_hz = every_hz[every_hz <= CARRIED_SHARE * rate].max(initial=0.0)
    fast = STEPS_PER_FAST_PERIOD * float(every_hz.max())
    step_s = 1 / max(STEPS_PER_PERIOD * float(carried_hz), fast)
    forces, integration = _stage_forces(train, drive, grid, step_s, progress)
    _add_profile(forces, train, drive, grid)
    fade_ends(forces, math.ceil(_FLANK_S / grid.cell_s))
    spectra = band_spectrum(forces, oversampling)
    heard = through_path(path, spectra, samples, rate)
    return heard[:, lead : lead + settings.samples].copy(), integration


def _stage_forces(
    train: Train, drive: Drive, grid: _Grid, step_s: float, progress: Progress | None
) -> tuple[FloatArray, dict[str, float]]:
    """Return the dynamic force that every stage puts on the housing, cell by cell."""
    run_in_s = RUN_IN_CONSTANTS / train.system.decay_rate
    in_memory = STEPS_PER_BLOCK // len(train.meshes) * step_s
    per_block = max(1, min(grid.cells, int(in_memory / grid.cell_s)))
    forces = np.zeros((len(train.carrier_orders), grid.cells))
    state, carried, mismatch, steps = None, None, 0.0, 0
    before_s = grid.edge_s(0) - run_in_s
    for first in range(0, grid.cells, per_block):
        last = min(first + per_block, grid.cells)
        span = (before_s, grid.edge_s(last))
        course = contact_course(train.meshes, drive, span, step_s)
        # pieces end at events too: most are shorter than the longest
        run_in = math.ceil(run_in_s * course.pieces / (span[1] - span[0]))
        share = part_of(progress, first / grid.cells, (last - first) / grid.cells)
        result = integrate(train.system, course, run_in=run_in, start=state, progress=share)
        means, carried = triangle_means(
            result, grid.edge_s(first), grid.cell_s, last - first, carried
        )
        means -= train.static_force[:, None]
        # to the stages they belong to, those of planets louder as they pass
        times = grid.edge_s(first) + grid.cell_s * np.arange(last - first)
        turns = drive.motion.turns(times) if any(train.carrier_orders) else times
        for mesh, mean in zip(train.meshes, means, strict=True):
            carrier = train.carrier_orders[mesh.mechanics.stage - 1]
            if carrier:
                passing = 0.5 + 0.5 * np.cos(2 * np.pi * (carrier * turns + mesh.place_turns))
                mean *= 1 - PLANET_PASS_DEPTH * (1 - passing)
            forces[mesh.mechanics.stage - 1, first:last] += mean
        state, before_s = result.end_state, span[1]
        mismatch, steps = max(mismatch, result.joint_mismatch), steps + course.pieces * SUBSTEPS
    return forces, {"longest_step_s": step_s, "steps": steps, "joint_mismatch": mismatch}


def _add_profile(forces: FloatArray, train: Train, drive: Drive, grid: _Grid) -> None:
    """Add to the stages the forces of profile that is missing at the ends of all contacts.

    It moves all pairs alike, with the mesh: through the linear mesh with its mean stiffness.
    """
    angular = 2 * math.pi * np.fft.rfftfreq(grid.cells, grid.cell_s)
    for number, mesh in enumerate(train.meshes):
        depth = sum(errors.profile_m for errors in mesh.errors)
        if not depth:
            continue
        times = grid.edge_s(0) + grid.cell_s * np.arange(grid.cells)
        phase = mesh.phase(drive.motion.turns(times))
        missing = np.fft.rfft(depth * (2 / math.pi - np.abs(np.sin(math.pi * phase))))
        system = train.system
        inertia = angular**2 / float(system.vectors[number] @ system.vectors[number])
        spring = system.means[number] + 1j * angular * system.dampers[number]
        force = spring * inertia / (spring - inertia) * missing
        forces[mesh.mechanics.stage - 1] += np.fft.irfft(force, grid.cells)


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
        modes = zip(self.frequencies_hz, self.damping_ratios, weights, strict=True)
        for own_hz, damping, weight in modes:
            total -= weight / _resonance(frequency_hz, own_hz, damping)
        total *= frequency_hz * frequency_hz / self.housing_mass_kg
        bearing_hz = float(self.bearing_hz[stage])
        total *= bearing_hz**2 / _resonance(frequency_hz, bearing_hz, BEARING_DAMPING)
        return total


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
