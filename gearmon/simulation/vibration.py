"""The vibration that the meshes make: integrated, sampled and passed to the sensors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.simulation import path as paths
from gearmon.simulation.contact import Drive, contact_course
from gearmon.simulation.integrate import integrate
from gearmon.simulation.sampling import band_spectrum, fade_ends, triangle_means
from gearmon.simulation.settings import Settings
from gearmon.simulation.system import SUBSTEPS
from gearmon.simulation.train import Train
from gearmon.simulation.truth import Integration

FloatArray = NDArray[np.float64]
Progress = Callable[[float], None]

#: Steps of the integration in a period of the fastest natural frequency that the recording carries:
#: the dynamic mesh force is then right to about 3e-4 of its rms.
STEPS_PER_PERIOD = 24
#: Steps in a period of faster ones, which only have to stay stable and damped.
STEPS_PER_FAST_PERIOD = 10
#: Share of the sampling rate up to which a natural frequency counts as carried.
CARRIED_SHARE = 0.6
#: Time constants of the slowest transient in the run-in of a chunk: e^-14 = 1e-6.
RUN_IN_CONSTANTS = 14.0
#: Cells of the fine grid per sample, and per period of the fastest natural frequency.
CELLS_PER_SAMPLE, CELLS_PER_PERIOD = 8, 6
#: Steps of one mesh that are held in memory at a time.
STEPS_PER_BLOCK = 5_000_000
#: Part of a planet's mesh force that is heard only while it passes the sensor.
PLANET_PASS_DEPTH = 0.8
# Cosine flanks that let the record begin and end without a blow [s], beyond what is kept.
_FLANK_S = 0.02


@dataclass(frozen=True, kw_only=True)
class _Grid:
    """Samples and cells of a record with a lead and a tail that are cut off at the end."""

    samples: int
    lead: int
    oversampling: int
    rate_hz: float

    @property
    def cells(self) -> int:
        return self.samples * self.oversampling

    @property
    def cell_s(self) -> float:
        return 1 / (self.rate_hz * self.oversampling)

    def edge_s(self, cell: int) -> float:
        return (cell - self.lead * self.oversampling) * self.cell_s


def _grid(settings: Settings, path: paths.ModalPath, fastest_hz: float) -> _Grid:
    rate = settings.sampling_rate_hz
    flank = math.ceil(_FLANK_S * rate) + 8
    lead = flank + math.ceil(path.decay_s() * rate)
    samples = _smooth_even(settings.samples + lead + 2 * flank)
    cells = max(CELLS_PER_SAMPLE, math.ceil(CELLS_PER_PERIOD * fastest_hz / rate))
    return _Grid(samples=samples, lead=lead, oversampling=_smooth(cells), rate_hz=rate)


def mesh_vibration(
    train: Train, drive: Drive, settings: Settings, progress: Progress | None
) -> tuple[FloatArray, Integration]:
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
    (ndarray, Integration)
        Accelerations [m/s2], shape (channels, samples), and how they were computed.
    """
    stages = len(train.carrier_orders)
    path = paths.random_path(settings.machine_seed, settings.channels, stages, train.gear_mass_kg)
    frequencies = train.system.natural_frequencies_hz(train.greatest_stiffness)
    grid = _grid(settings, path, frequencies[-1])
    forces, integration = _stage_forces(train, drive, grid, frequencies, progress)
    fade_ends(forces, math.ceil(_FLANK_S / grid.cell_s))
    spectra = band_spectrum(forces, grid.oversampling)
    heard = paths.through_path(path, spectra, grid.samples, grid.rate_hz)
    return heard[:, grid.lead : grid.lead + settings.samples].copy(), integration


def _stage_forces(
    train: Train,
    drive: Drive,
    grid: _Grid,
    frequencies_hz: FloatArray,
    progress: Progress | None,
) -> tuple[FloatArray, Integration]:
    """Return the dynamic force that every stage puts on the housing, cell by cell."""
    step_s = _longest_step_s(frequencies_hz, grid.rate_hz)
    run_in_s = RUN_IN_CONSTANTS / train.system.decay_rate(train.mean_stiffness)
    run_in = math.ceil(run_in_s / (SUBSTEPS * step_s))
    in_memory = STEPS_PER_BLOCK // len(train.meshes) * step_s
    per_block = max(1, min(grid.cells, int(in_memory / grid.cell_s)))
    static = train.static_deformation
    forces = np.zeros((len(train.carrier_orders), grid.cells))
    state, carried, mismatch, steps = None, None, 0.0, 0
    before_s = grid.edge_s(0) - run_in_s
    for first in range(0, grid.cells, per_block):
        last = min(first + per_block, grid.cells)
        span = (before_s, grid.edge_s(last))
        course = contact_course(train.meshes, drive, span, step_s)
        share = _share(progress, first / grid.cells, (last - first) / grid.cells)
        result = integrate(train.system, course, static, run_in=run_in, start=state, progress=share)
        means, carried = triangle_means(
            result, grid.edge_s(first), grid.cell_s, last - first, carried
        )
        means -= train.static_force[: len(means), None]
        _add_to_stages(forces[:, first:last], train, drive, means, grid, first)
        state, before_s = result.end_state, span[1]
        mismatch, steps = max(mismatch, result.joint_mismatch), steps + course.pieces * SUBSTEPS
    return forces, Integration(
        longest_step_s=step_s, steps=steps, joint_mismatch=mismatch, frequencies_hz=frequencies_hz
    )


def _longest_step_s(frequencies_hz: FloatArray, rate_hz: float) -> float:
    carried = frequencies_hz[frequencies_hz <= CARRIED_SHARE * rate_hz]
    slow = STEPS_PER_PERIOD * float(carried.max(initial=0.0))
    return 1 / max(slow, STEPS_PER_FAST_PERIOD * float(frequencies_hz[-1]))


def _share(progress: Progress | None, start: float, part: float) -> Progress | None:
    if progress is None:
        return None
    return lambda done: progress(start + part * done)


def _add_to_stages(
    forces: FloatArray, train: Train, drive: Drive, means: FloatArray, grid: _Grid, first: int
) -> None:
    """Add the mesh forces of some cells to the stages they belong to, in place."""
    times = grid.edge_s(first) + grid.cell_s * np.arange(means.shape[1])
    turns = drive.motion.turns(times) if any(train.carrier_orders) else times
    for mesh, mean in zip(train.meshes, means, strict=True):
        carrier = train.carrier_orders[mesh.stage - 1]
        if carrier:
            passing = 0.5 + 0.5 * np.cos(2 * np.pi * (carrier * turns + mesh.place_turns))
            mean *= 1 - PLANET_PASS_DEPTH * (1 - passing)
        forces[mesh.stage - 1] += mean


def _smooth_even(least: int) -> int:
    """Return the least even number from `least` on without prime factors above 5."""
    return 2 * _smooth(-(-least // 2))


def _smooth(least: int) -> int:
    """Return the least number from `least` on without prime factors above 5."""
    number = max(least, 1)
    while True:
        rest = number
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return number
        number += 1
