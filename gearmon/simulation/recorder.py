"""Recordings of a simulated machine, and what is true of them for those who judge findings."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from gearmon import __version__
from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, check_word
from gearmon.files import replacing, write_atomically
from gearmon.gears.faults import Fault, GearError, faults_of
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, MachineLike, OperatingPoint, load_machine
from gearmon.result import Result, sample_rows, with_units
from gearmon.simulation.contact import Drive, ShaftMotion, ToothMesh, random_wander
from gearmon.simulation.train import Settings, Train, build_train, stream
from gearmon.simulation.vibration import (
    BEARING_SLIP,
    mesh_vibration,
    noise,
    shaft_lines,
    tacho_pulses,
    tones,
)
from gearmon.terminal import Progress

#: Voltage and length of a tacho pulse.
TACHO_HIGH_V, TACHO_WIDTH_TURNS = 5.0, 0.05


#: Rows that are formatted at a time.
ROWS_AT_A_TIME = 20_000

MODEL = (
    "equations of motion integrated in time: the elastic system of the machine file with shafts "
    "(torsion, and bending where they are told), bearings, carriers, planets and pins; every tooth "
    "pair with its own parabolic stiffness, damage and pitch deviation, meshes that cannot pull "
    "but meet their opposite flanks beyond the backlash, runout of the gears; mesh forces heard "
    "through random modes of the housing; without friction and profile relief"
)
# Settings that are told as they were given.
_TOLD = (
    *("machine_seed", "recording_seed", "sampling_rate_hz", "channels"),
    *("tacho_shaft", "snr_db", "accuracy_grade"),
)
#: Disagreement of chunks above which the motion is called irregular.
IRREGULAR = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedRecording(Result):
    """A recording of a simulated machine, with what is true of it.

    Parameters
    ----------
    samples : ndarray, shape (columns, n)
        Accelerations [m/s2]; with a tacho its voltage as the last row.
    sampling_rate_hz : float
    channel_names, channel_kinds, units : tuple of str
        One for each column: kinds are "vibration" and "tacho".
    truth : dict
        Ready for JSON; see `simulate`.
    """

    samples: FloatArray
    sampling_rate_hz: float
    channel_names: tuple[str, ...]
    channel_kinds: tuple[str, ...]
    units: tuple[str, ...]
    truth: dict[str, Any]

    @property
    def duration_s(self) -> float:
        """Length [s]."""
        return float(self.samples.shape[1] / self.sampling_rate_hz)

    def to_dict(self) -> dict[str, Any]:
        """Return the truth: built-in types only, ready for JSON."""
        return self.truth

    def frame_rows(self) -> list[dict[str, Any]]:
        """Return a row a sample, as a recording has them."""
        heads = with_units(self.channel_names, self.units)
        return sample_rows(self.samples, self.sampling_rate_hz, heads)


def simulate(
    machine: MachineLike,
    faults: Fault | GearError | str | Iterable[Fault | GearError | str] = (),
    duration_s: float = 10.0,
    sampling_rate_hz: float = 20_000.0,
    seed: int = 0,
    *,
    point: OperatingPoint | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> SimulatedRecording:
    """Simulate a recording of a machine by integrating its equations of motion.

    Parameters
    ----------
    machine : Machine, path or dict
        With module, face width and torque, or the overrides in their place.
    faults : iterable of Fault, GearError or str
        As "crack:1:pinion:5:20%", and errors as "eccentricity:1:pinion:all:20um" that come to
        those of manufacture: eccentricity, cumulative, pitch, and profile of all teeth.
    duration_s, sampling_rate_hz : float
        Length [s], at least one turn of the slowest shaft, and rate [Hz].
    seed : int
        Taken for `machine_seed` and `recording_seed` where these are not given. Give the same
        `machine_seed` to a healthy and a faulty recording and they are of the same machine, with
        the same pitch errors and the same path to the sensors.
    point : OperatingPoint, optional
        By default the machine's first.
    progress : callable, optional
        Called now and then with the share done, 0 to 1.
    **settings
        See `Settings`: machine_seed, recording_seed, channels, load, slip, speed_drift, load_drift,
        torque_ripple, snr_db, accuracy_grade, unbalance, bearing_tones, mains_hz, tacho_shaft.

    Returns
    -------
    SimulatedRecording
        Its `truth` holds seeds, speed, load, mesh frequencies, faults, errors of manufacture and
        what the model takes for granted.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, the machine lacks data, or they do not fit together.

    Notes
    -----
    The machine is the elastic system of `gearmon.modes` in its modes up to the sampling rate and
    those by which it yields to mesh forces beyond: ``p'' + C p' + K p = G u(t) - V' s`` with
    ``s = sum_p k_p(theta) max(0, d - e_p) + c d'``, never below zero, for every mesh with its
    deflection d = V p beyond the runout of its gears; k_p is the parabolic stiffness of pair p
    times the health of its two teeth and e_p the sum of their pitch deviations. Beyond the backlash
    the opposite flanks push back; u are the load and the acceleration of runout, which a set with
    a floating sun does not feel. A profile error moves all pairs alike; its force is that of the
    linear mesh with its mean stiffness. The steps of the integration end where pairs enter and
    leave contact. The mesh forces pass through random modes of the housing to the sensors, those
    of planets louder when they pass. Left out are friction, lubrication, profile relief and
    contact beyond the line of action.

    Examples
    --------
    >>> recording = gearmon.simulate(machine, crack, 1.0, 4000.0, seed=1, channels=1)
    >>> recording.samples.shape, recording.truth["faults"][0]["tooth"]
    ((1, 4000), 7)
    """
    for name in settings:
        check_word("setting ", name, [own.name for own in fields(Settings)])
    wanted: dict[str, Any] = {"duration_s": duration_s, "sampling_rate_hz": sampling_rate_hz}
    wanted |= {"machine_seed": seed, "recording_seed": seed} | settings
    known = faults_of(faults, errors=True)
    made = load_machine(machine), known, Settings(**wanted)
    return record(*made, point=point, progress=progress)


def record(
    machine: Machine,
    faults: tuple[Fault | GearError, ...] = (),
    settings: Settings | None = None,
    *,
    point: OperatingPoint | None = None,
    progress: Progress | None = None,
) -> SimulatedRecording:
    """Simulate a recording as `settings` say.

    Parameters
    ----------
    machine : Machine
    faults : tuple of Fault or GearError
    settings : Settings, optional
    point : OperatingPoint, optional
        By default the machine's first.
    progress : callable, optional
        Called now and then with the share done, 0 to 1.

    Returns
    -------
    SimulatedRecording
        See `simulate`, which also says what is raised.
    """
    wanted = Settings() if settings is None else settings
    running = machine.operating[0] if point is None else point
    wanted.check_against(machine, running)
    train = build_train(
        machine,
        faults,
        point=running,
        load=wanted.load,
        seed=wanted.machine_seed,
        accuracy_grade=wanted.accuracy_grade,
        carried_hz=wanted.sampling_rate_hz,
    )
    drive = _drive(machine, wanted, running)
    vibration, integration = mesh_vibration(train, drive, wanted, progress)
    times = np.arange(wanted.samples) / wanted.sampling_rate_hz
    turns, speed = drive.motion.turns(times), drive.motion.speed_hz(times)
    vibration += _additions(machine, wanted, vibration, turns, speed)
    columns = [(f"a{i + 1}", "vibration", "m/s2", row) for i, row in enumerate(vibration)]
    if wanted.tacho_shaft is not None:
        order = kinematics(machine).shaft(wanted.tacho_shaft).order
        pulse = wanted.sampling_rate_hz, order * speed, TACHO_HIGH_V, TACHO_WIDTH_TURNS
        columns.append(("tacho", "tacho", "V", tacho_pulses(order * turns, *pulse)))
    names, kinds, units, rows = zip(*columns, strict=True)
    return SimulatedRecording(
        samples=np.array(rows),
        sampling_rate_hz=wanted.sampling_rate_hz,
        channel_names=names,
        channel_kinds=kinds,
        units=units,
        truth=_truth(machine, faults, wanted, running, train, drive, integration),
    )


def _drive(machine: Machine, settings: Settings, point: OperatingPoint) -> Drive:
    ripples = []
    for shaft in kinematics(machine).shafts:
        generator = stream(settings.machine_seed, "ripple", shaft.number)
        size, angle = generator.uniform(0.3, 1.0), generator.uniform(0, 2 * math.pi)
        ripples.append((shaft.order, settings.torque_ripple * size, angle))
    seed, mean_hz = settings.recording_seed, settings.mean_shaft1_hz(point)
    wander = random_wander(settings.speed_drift, stream(seed, "speed"))
    start_turns = float(stream(seed, "start").uniform(0, 1000))
    motion = ShaftMotion(mean_hz=mean_hz, wander=wander, start_turns=start_turns)
    load = random_wander(settings.load_drift, stream(seed, "load"))
    return Drive(motion=motion, load=load, ripples=tuple(ripples))


def _additions(
    machine: Machine,
    settings: Settings,
    vibration: FloatArray,
    turns: FloatArray,
    speed_hz: FloatArray,
) -> FloatArray:
    """Return what is not gears: shafts, bearings, mains and noise."""
    train = kinematics(machine)
    rms = np.asarray(np.sqrt(np.mean(vibration**2, axis=1)), dtype=np.float64)
    orders = [shaft.order for shaft in train.shafts]
    seed = settings.machine_seed
    extra = settings.unbalance * shaft_lines(seed, orders, turns, speed_hz, settings.channels)
    if settings.bearing_tones:
        lines = [x.order * (1 - BEARING_SLIP) for x in train.lines if x.kind == "bearing"]
        extra += tones(seed, lines, turns, settings.bearing_tones * rms, 3)
    if settings.mains_hz is not None:
        periods = np.arange(len(turns), dtype=np.float64)
        periods *= settings.mains_hz / settings.sampling_rate_hz
        extra += tones(seed, [2.0], periods, 0.1 * rms, 1)
    if settings.snr_db is not None:
        level = np.sqrt(np.mean((vibration + extra) ** 2, axis=1)) * 10 ** (-settings.snr_db / 20)
        for channel, row in enumerate(extra):
            generator = stream(settings.recording_seed, "noise", channel)
            row += noise(generator, len(turns), float(level[channel]))
    return extra


def _truth(
    machine: Machine,
    faults: tuple[Fault | GearError, ...],
    settings: Settings,
    point: OperatingPoint,
    train: Train,
    drive: Drive,
    integration: dict[str, float],
) -> dict[str, Any]:
    """Return all that is known of a simulated recording, in built-in types.

    Returns
    -------
    dict
        Ready for JSON. Tooth j of a gear with z teeth enters contact whenever the mesh phase is
        j - 1 modulo z; shaft 1 passes a whole turn at each of ``speed.turn_times_s``.
    """
    speed = _speed(settings, point, drive)
    wander = settings.load * (1 + drive.load.value(_times(settings)))
    notes = [*train.notes]
    for mesh in train.meshes:
        notes += mesh.mechanics.stiffness.warnings
    if integration["joint_mismatch"] > IRREGULAR:
        notes.append(
            "irregular motion with loss of contact: parts of the record are faded from one "
            "possible motion into another"
        )
    return {
        "kind": "truth of a simulated recording",
        "gearmon_version": __version__,
        "numpy_version": np.__version__,
        "model": MODEL,
        "machine": machine.name,
        "machine_file": Path(machine.path).name,
        **{name: getattr(settings, name) for name in _TOLD},
        "duration_s": settings.samples / settings.sampling_rate_hz,
        "samples": settings.samples,
        # a fault that is given as a loss of nothing changes nothing
        "condition": "fault" if any(_stiffness_loss(own) != 0 for own in faults) else "healthy",
        "faults": [_fault(fault) for fault in faults],
        "speed": speed,
        "load": {
            "nominal_torque_nm": point.torque_nm,
            "mean_share": float(wander.mean()),
            "min_share": float(wander.min()),
            "max_share": float(wander.max()),
        },
        "shafts": [
            {"shaft": s.number, "order": s.order, "mean_hz": s.order * speed["mean_hz"]}
            for s in kinematics(machine).shafts
        ],
        "mesh": [
            {"stage": m.stage, "order": m.order, "frequency_hz": m.order * speed["mean_hz"]}
            for m in kinematics(machine).meshes
        ],
        "meshes": [_mesh(mesh, drive) for mesh in train.meshes],
        "natural_frequencies_hz": train.system.natural_frequencies_hz().tolist(),
        "integration": integration,
        "notes": list(dict.fromkeys(notes)),
    }


def _stiffness_loss(fault: Fault | GearError) -> float | None:
    return fault.loss if isinstance(fault, Fault) and fault.is_loss else None


def _fault(fault: Fault | GearError) -> dict[str, Any]:
    return {
        "fault": str(fault),
        **{name: getattr(fault, name) for name in ("kind", "stage", "gear", "tooth")},
        "stiffness_loss": _stiffness_loss(fault),
        "size": str(fault).rsplit(":", 1)[-1],
    }


def _speed(settings: Settings, point: OperatingPoint, drive: Drive) -> dict[str, Any]:
    motion, times = drive.motion, _times(settings)
    speed = motion.speed_hz(times)
    first, last = motion.turns(times[[0, -1]])
    turn_times = motion.times_s(np.arange(np.ceil(first), np.floor(last) + 1))
    return {
        "shaft": 1,
        "nominal_hz": point.shaft1_hz,
        "mean_hz": float((last - first) / times[-1]),
        "min_hz": float(speed.min()),
        "max_hz": float(speed.max()),
        "start_turns": motion.start_turns,
        "turn_times_s": np.round(turn_times, 9).tolist(),
    }


def _times(settings: Settings) -> FloatArray:
    """Return instants at which slow wander is told [s]."""
    return np.linspace(0.0, settings.samples / settings.sampling_rate_hz, 4097)


def _mesh(mesh: ToothMesh, drive: Drive) -> dict[str, Any]:
    mechanics, stiffness = mesh.mechanics, mesh.mechanics.stiffness
    return {
        "stage": mechanics.stage,
        "mesh": mesh.name,
        "teeth": list(mesh.teeth),
        "phase_at_start": float(mesh.phase(np.array([drive.motion.start_turns]))[0]),
        "force_n": mechanics.force_n,
        "mean_stiffness_n_per_m": stiffness.healthy_mean_n_per_m,
        "equivalent_mass_kg": mechanics.equivalent_mass_kg,
        "damping_ns_per_m": mechanics.damping_ns_per_m,
        "contact_ratio": stiffness.contact_ratio,
        "overlap_ratio": stiffness.overlap_ratio,
        "backlash_m": mesh.backlash_m,
        "errors": [
            {name: np.round(value, 12).tolist() for name, value in vars(errors).items()}
            for errors in mesh.errors
        ],
    }


def write_simulation(
    recording: SimulatedRecording, path: str | Path, *, with_time: bool = True
) -> tuple[Path, Path]:
    """Write a simulated recording as CSV and its truth as JSON beside it.

    Parameters
    ----------
    recording : SimulatedRecording
    path : str or Path
        Of the CSV, ending in ``.csv``; the truth gets the same name with ``.json``.
    with_time : bool
        Whether the first column is the time. Without it whoever reads the file must be told the
        sampling rate.

    Returns
    -------
    (Path, Path)
        The CSV and the JSON file.

    Raises
    ------
    ArgumentError
        If the name does not end in ``.csv`` or the file cannot be written.

    Notes
    -----
    The header holds names and units, ``a1 (m/s2)``. Values have six significant digits, times
    nine decimals.
    """
    target = Path(path)
    if target.suffix.lower() != ".csv":
        raise ArgumentError(f"{target}: the name of a simulated recording must end in .csv")
    truth = target.with_suffix(".json")
    columns = zip(recording.channel_names, recording.units, strict=True)
    header = [f"{name} ({unit})" for name, unit in columns]
    form = ["%.6g"] * len(header)
    if with_time:
        header, form = ["time (s)", *header], ["%.9f", *form]
    line = ",".join(form) + "\n"
    with (
        replacing(target) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(",".join(header) + "\n")
        for start in range(0, recording.samples.shape[1], ROWS_AT_A_TIME):
            rows = recording.samples[:, start : start + ROWS_AT_A_TIME].T
            if with_time:
                times = np.arange(start, start + len(rows)) / recording.sampling_rate_hz
                rows = np.column_stack([times, rows])
            # one format for many rows is several times as fast as one for each
            file.write(line * len(rows) % tuple(rows.ravel().tolist()))
    write_atomically(truth, json.dumps(recording.truth, indent=1, ensure_ascii=False) + "\n")
    return target, truth
