"""Tasks of gearmon beside their competitors: recordings, mesh stiffness, harvesters.

Of recordings single steps are taken in turn with the methods they replace (spectra, kurtogram,
indicators, reading); of whole processes the figures are what a user waits for, and what the machine
must hold. The competitor of mesh stiffness is ROSS: the same gears of the same steel in another
environment. Harvesters are tuned beside time integration of pair and harvester, and brute force.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark.detection_machines import Condition, Setting, draw_machine
from gearmon.benchmark.dynamics import draw_sweep
from gearmon.benchmark.equations import CRACK, FORM, PERIOD_S, STAGE, Case
from gearmon.benchmark.rivals import shooter
from gearmon.benchmark.timing import NO_LIMIT_S, Row, Task, Timing, absent, competitor, interleaved
from gearmon.dynamics import HillProblem, steady_state
from gearmon.files import write_atomically
from gearmon.gears.faults import Fault, parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.gears.tooth import Foundation, ToothBeam
from gearmon.gears.tooth_pairs import teeth_of
from gearmon.harvesting import InertialHarvester, OperatingShare, tune_harvester, vibration_of_lines
from gearmon.harvesting.harvester import Harvester
from gearmon.harvesting.response import mean_power_w
from gearmon.harvesting.tuning import built_in
from gearmon.machine import Machine, ParallelStage, load_machine
from gearmon.machine.parts import example_machine
from gearmon.signals.recording import read_recording
from gearmon.signals.spectra import amplitude_spectrum, envelope_spectrum, kurtogram, power_density
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress, followed

#: The first is gearmon's.
Tasks = dict[str, Task]
Duty = tuple[OperatingShare, ...]

LEVELS = 8
RATE_HZ = 20_000.0
#: Of the recording that is analysed as a whole.
WHOLE_RATE_HZ, WHOLE_S = 4266.6667, 12.0


def run_signals(progress: Progress | None = None, *, quick: bool = False) -> list[Row]:
    """Time the work on signals beside its competitors.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        A sixteenth of the samples and fewer repeats: rough figures in seconds.

    Returns
    -------
    list of dict
        Rows with case, method, samples, channels, median_s, fastest_s, repeats,
        times_own (median of the method over that of gearmon in the same turns) and a note.
    """
    count, repeats = 1 << (16 if quick else 20), 3 if quick else 15
    long = 500_000 if quick else 10_000_000
    steps: list[Callable[[], list[Row]]] = [
        lambda: _spectra(count, repeats),
        lambda: _kurtogram(count, min(repeats, 7)),
        lambda: _reading(long, 1, 2 if quick else 4),
        lambda: _reading(long, 4, 1 if quick else 3),
    ]
    return [row for step in followed(steps, len(steps), progress) for row in step()]


def _timed(
    case: str, tasks: Tasks, repeats: int, budget_s: float, samples: int, channels: int = 1
) -> list[Row]:
    """Return one row a method; the first is gearmon's."""
    timings = interleaved(list(tasks.values()), repeats, budget_s)
    sizes = {"samples": samples, "channels": channels}
    return [
        {"case": case, "method": name, **sizes, **timing.columns()}
        | {"times_own": timing.median_s / timings[0].median_s, "note": ""}
        for name, timing in zip(tasks, timings, strict=True)
    ]


def _spectra(count: int, repeats: int) -> list[Row]:
    samples = np.random.default_rng(0).normal(size=count)
    # 999,983 and 65,521 are primes
    prime = samples[: 999_983 if count > 1 << 18 else 65_521]
    smooth = samples[: len(prime) // 1000 * 1000]
    sections = scipy.signal.butter(4, (0.2, 0.4), btype="bandpass", output="sos")

    def usual_envelope() -> FloatArray:
        size = np.abs(scipy.signal.hilbert(scipy.signal.sosfiltfilt(sections, samples)))
        return np.asarray(np.abs(scipy.fft.rfft(size - size.mean())))

    cases: dict[str, Tasks] = {
        "amplitude spectrum": {
            "amplitude_spectrum": partial(amplitude_spectrum, samples, 1.0),
            "scipy.fft.rfft": partial(scipy.fft.rfft, samples),
        },
        "amplitude spectrum of a prime length": {
            "prime length": partial(amplitude_spectrum, prime, 1.0),
            "smooth neighbour": partial(amplitude_spectrum, smooth, 1.0),
            "numpy.fft.rfft, prime length": partial(np.fft.rfft, prime),
        },
        "envelope spectrum": {
            "envelope_spectrum": partial(envelope_spectrum, samples, 1.0, 0.1, 0.2),
            "SciPy: Butterworth, hilbert, rfft": usual_envelope,
        },
    }
    for block in (1024, 8192):
        cases[f"power density, blocks of {block}"] = {
            "power_density": partial(power_density, samples, 1.0, block),
            "scipy.signal.welch": partial(scipy.signal.welch, samples, nperseg=block),
        }
    return [row for case, own in cases.items() for row in _timed(case, own, repeats, 5.0, count)]


def _kurtogram(count: int, repeats: int) -> list[Row]:
    samples = np.random.default_rng(0).normal(size=count)
    case = f"kurtogram, {LEVELS} levels"
    tasks: Tasks = {"kurtogram": partial(kurtogram, samples, 1.0, LEVELS)}
    if find_spec("pysdkit") is None:
        alone = _timed(case, tasks, repeats, 5.0, count)
        return [row | {"note": absent("PySDKit")} for row in alone]
    theirs = competitor("pysdkit.utils._kurtogram").fast_kurtogram
    levels = min(LEVELS, int(np.log2(count)) - 7)
    tasks[f"PySDKit {version('PySDKit')}"] = partial(theirs, samples, levels, 1.0)
    return _timed(case, tasks, repeats, NO_LIMIT_S, count)


@contextmanager
def _long_recording(count: int, channels: int = 1) -> Iterator[Path]:
    """Write the example gearbox and so many rows of its vibration, as a logger would.

    Ten seconds are simulated and repeated: the seams do not matter for reading and memory.
    """
    import pandas as pd

    with tempfile.TemporaryDirectory() as folder:
        machine, path = _example(Path(folder)), Path(folder) / "long.csv"
        made = simulate(machine, duration_s=10.0, sampling_rate_hz=RATE_HZ, channels=channels)
        names = [f"a{n + 1}" for n in range(channels)]
        table = pd.DataFrame(made.samples[:, :count].T, columns=names)
        table[:0].to_csv(path, index=False)
        whole, rest = divmod(count, len(table))
        block = table.to_csv(index=False, header=False, float_format="%.6g")
        with path.open("a", encoding="ascii") as file:
            file.writelines(block for _ in range(whole))
            table[:rest].to_csv(file, index=False, header=False, float_format="%.6g")
        yield path


def _example(folder: Path) -> Machine:
    """Write the file of the example gearbox into a folder and load it."""
    write_atomically(folder / "machine.toml", example_machine())
    return load_machine(folder / "machine.toml")


def _reading(count: int, channels: int, repeats: int) -> list[Row]:
    """Readers of CSV that are installed, no result kept; of one channel also what comes after."""
    import pandas as pd

    readers: dict[str, Callable[[Path], Any]] = {
        "read_recording": lambda path: read_recording(path, sampling_rate_hz=RATE_HZ).samples,
        "pandas.read_csv": pd.read_csv,
    }
    for name, module in (("pyarrow", "pyarrow.csv"), ("polars", "polars")):
        if find_spec(name):
            readers[name] = import_module(module).read_csv
    with _long_recording(count, channels) as path:
        tasks: Tasks = {name: partial(_rows_read, read, path) for name, read in readers.items()}
        rows = _timed("reading CSV", tasks, repeats, 60.0, count, channels)
        if channels == 1:
            # seams would be slips of the angle, and looking for those takes time
            drawn = draw_machine(np.random.default_rng(0), channels=1)
            known = drawn.take(Condition(), Setting(duration_s=count / RATE_HZ)).recording
            own = partial(indicator_table, known.vibration(), drawn.machine)
            tasks = {
                "indicator_table of samples in memory": own,
                "pandas.read_csv of as many samples": partial(pd.read_csv, path),
            }
            rows += _timed("from samples to all indicators", tasks, repeats, NO_LIMIT_S, count)
    return rows


def _rows_read(read: Callable[[Path], Any], path: Path) -> int:
    return len(read(path))


def analysis_against_reading(repeats: int = 7, progress: Progress | None = None) -> list[Row]:
    """Time one analysis, start of process to JSON, against pandas reading the same CSV.

    A recording of 12 s and four channels is simulated, a reference learned; then both processes run
    in turn, so that a drifting machine speed hits both.

    Parameters
    ----------
    repeats : int
        Counted runs of each, after one warm-up.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a process, with median and least time and the ratio of the medians.
    """
    with tempfile.TemporaryDirectory() as folder:
        processes = _prepared(Path(folder))
        tasks = [partial(subprocess.run, own, capture_output=True) for own in processes.values()]
        timings = interleaved(tasks, repeats, NO_LIMIT_S)
    sizes = {"rows": round(WHOLE_RATE_HZ * WHOLE_S), "channels": 4}
    pandas_s, timed = timings[-1].median_s, zip(processes, timings, strict=True)
    return [
        {"process": name, **sizes, **own.columns(), "ratio_to_pandas": own.median_s / pandas_s}
        for name, own in followed(timed, len(timings), progress)
    ]


def _prepared(place: Path) -> dict[str, list[str]]:
    """Write machine, recordings and reference; return the arguments of both processes."""
    machine = _example(place)
    for number, (name, *faults) in enumerate((("healthy",), ("new", "crack:1:pinion:7:30%"))):
        made = simulate(machine, faults, WHOLE_S, WHOLE_RATE_HZ, channels=4, recording_seed=number)
        write_simulation(made, place / f"{name}.csv", with_time=False)
    healthy, new, reference = (f"{place}/{name}" for name in ("healthy.csv", "new.csv", "ref"))
    learn = _command("learn", healthy, place, WHOLE_RATE_HZ, "-o", reference)
    subprocess.run(learn, check=True, capture_output=True)
    analyse = _command("analyse", new, place, WHOLE_RATE_HZ, "--reference", reference, "--json")
    pandas = [sys.executable, "-c", f"import pandas; pandas.read_csv({new!r})"]
    return {"analyse": analyse, "pandas.read_csv": pandas}


def _command(name: str, recording: str, folder: Path, rate_hz: float, *more: str) -> list[str]:
    known = ["--machine", str(folder / "machine.toml"), "--sampling-rate", str(rate_hz)]
    return [sys.executable, "-m", "gearmon", name, recording, *known, *more]


def memory_of_long_recording(
    rows: int = 10_000_000, columns: Sequence[int] = (1, 4), progress: Progress | None = None
) -> list[Row]:
    """Measure the peak memory of analysing a long CSV against the size of its numbers.

    Parameters
    ----------
    rows : int
        Rows of the CSV.
    columns : sequence of int
        Numbers of channels to try.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a number of channels.
    """
    results = []
    for count in followed(columns, len(columns), progress):
        with _long_recording(rows, count) as path:
            command = _command("analyse", str(path), path.parent, RATE_HZ, "--json")
            peak, elapsed = _peak_memory(command)
        numbers = 8 * rows * count
        sizes = {"numbers_mib": numbers / 2**20, "peak_mib": peak / 2**20, "ratio": peak / numbers}
        results.append({"rows": rows, "channels": count, **sizes, "elapsed_s": elapsed})
    return results


def _peak_memory(command: Sequence[str]) -> tuple[float, float]:
    """Peak resident memory of a process [bytes] and its elapsed time [s].

    Measured by a small process in between, whose only child it is.
    """
    script = (
        "import resource, subprocess, sys, time\n"
        "start = time.perf_counter()\n"
        "subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)\n"
        "usage = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(usage.ru_maxrss, time.perf_counter() - start)\n"
    )
    told = subprocess.check_output([sys.executable, "-c", script, *command], text=True)
    kibibytes, elapsed = map(float, told.split())
    return kibibytes * 1024, elapsed


#: A pair with published stiffness by ROSS.
PUBLISHED = replace(
    STAGE, pinion_teeth=25, gear_teeth=30, bore_diameter_pinion_mm=20.0, bore_diameter_gear_mm=20.0
)
POSITIONS = 1000


def time_stiffness(repeats: int = 25) -> list[Row]:
    """Return the run times of mesh stiffness by the energy of the teeth.

    Parameters
    ----------
    repeats : int, >= 1

    Returns
    -------
    list of dict
        One healthy mesh period at 200 positions; one turn of the pinion with a cracked tooth at
        200 positions a mesh; 1,000 harmonics of that; then 1,000 positions of a healthy mesh
        period, for two pairs, beside ROSS. Columns: case, positions (contact positions or samples
        that came out), median_s, fastest_s, repeats, positions_per_s; times_healthy (over one
        healthy mesh period taken in turn); ross_median_s, ross_times_slower and ross_difference
        (greatest relative difference of the stiffness, at the same contacts); note, which says
        where ROSS is not installed.
    """
    crack = [parse_fault(CRACK)]
    tasks = (
        partial(_sample, STAGE, 200),
        partial(_sample, STAGE, 200, crack),
        lambda: mesh_stiffness(STAGE, crack, FORM).harmonics(1000),
    )
    healthy, cracked, harmonics = interleaved(tasks, max(1, repeats), NO_LIMIT_S)
    ratio, turn = cracked.median_s / healthy.median_s, 200 * STAGE.pinion_teeth
    return [
        _stiffness_row("healthy mesh period", 200, healthy),
        _stiffness_row("pinion turn, one cracked tooth", turn, cracked, times_healthy=ratio),
        _stiffness_row("harmonics, one cracked tooth", 1000, harmonics),
        *(_beside_ross(stage, max(1, repeats)) for stage in (STAGE, PUBLISHED)),
    ]


def _stiffness_row(case: str, positions: int, timing: Timing, **further: Any) -> Row:
    known = {"case": case, "positions": positions, **timing.columns()}
    known["positions_per_s"] = positions / timing.median_s
    unknown = ("times_healthy", "ross_median_s", "ross_times_slower", "ross_difference")
    return known | dict.fromkeys(unknown) | {"note": ""} | further


def _sample(stage: ParallelStage, points: int, faults: Sequence[Fault] = ()) -> FloatArray:
    mesh = mesh_stiffness(stage, faults, FORM)
    return mesh.at(np.arange(mesh.period_mesh * points) / points)


def _beside_ross(stage: ParallelStage, repeats: int) -> Row:
    case = f"contact positions, sound pair {stage.pinion_teeth}/{stage.gear_teeth}"
    if find_spec("ross") is None:
        (own,) = interleaved([partial(_sample, stage, POSITIONS)], repeats, NO_LIMIT_S)
        return _stiffness_row(case, POSITIONS, own, note=absent("ROSS"))
    steel = competitor("ross.materials").steel
    mesh = _mesh_of_ross(stage, steel)
    # the same gears of the steel that ROSS has
    moduli = ("elastic_modulus_pinion_pa", "elastic_modulus_gear_pa")
    known: Row = dict.fromkeys(moduli, float(steel.E)) | {"poisson_ratio": float(steel.Poisson)}
    same = replace(stage, **known)
    theirs = partial(mesh.get_stiffness_for_mesh_period, n_mesh_period=1, n_points=POSITIONS)
    tasks = partial(_sample, same, POSITIONS), theirs
    own, other = interleaved(tasks, min(repeats, 7), NO_LIMIT_S)
    difference, note = _compared(mesh, same)
    beside = {"ross_median_s": other.median_s, "ross_difference": difference, "note": note}
    beside["ross_times_slower"] = other.median_s / own.median_s
    return _stiffness_row(case, len(mesh.stiffness_range), own, **beside)


def _mesh_of_ross(stage: ParallelStage, steel: Any) -> Any:
    module, mm = competitor("ross.gear_element"), 1e-3
    both = {"module": mm * (stage.module_mm or 0.0), "width": mm * (stage.face_width_mm or 0.0)}
    both |= {"pr_angle": math.radians(stage.pressure_angle_deg), "material": steel}
    bores_mm = stage.bore_diameter_pinion_mm or 0.0, stage.bore_diameter_gear_mm or 0.0
    gears = [
        module.GearElementTVMS(n=place, n_teeth=teeth, bore_diameter=mm * bores_mm[place], **both)
        for place, teeth in enumerate((stage.pinion_teeth, stage.gear_teeth))
    ]
    return module.Mesh(*gears)


def _compared(mesh: Any, stage: ParallelStage) -> tuple[float, str]:
    """Compare the stiffness with the teeth in contact where ROSS puts them.

    Returns
    -------
    (float, str)
        Greatest relative difference to its classical sum of the pairs, with its arm of the
        foundation; and what else there is to say, with neighbours that share the bodies here.
    """
    # the last position is the first of the next period, which ROSS counts to the old one
    stiffness = np.array(mesh.stiffness_range)[:-1]
    turned = np.array(mesh.theta_range)[:-1] * stage.pinion_teeth / (2 * np.pi) % 1.0
    double = turned <= float(mesh.contact_ratio) - 1
    same = _pair_stiffness(mesh, stage, turned)
    same[double] += _pair_stiffness(mesh, stage, turned[double] + 1)
    own = mesh_stiffness(stage, (), FORM).at(turned)
    single, two, own_single, own_two = (
        float(np.median(k[zone])) for k in (stiffness, own) for zone in (~double, double)
    )
    note = (
        f"ROSS {version('ross-rotordynamics')}: contact ratio {mesh.contact_ratio:.6g}, one pair "
        f"{single:.4g} N/m, two pairs {two:.4g} N/m by the classical sum; here "
        f"{mesh_pairs(stage)[0].contact_ratio:.6g}, {own_single:.4g} and {own_two:.4g} N/m "
        "with shared bodies"
    )
    return float(np.abs(same / stiffness - 1).max()), note


def _pair_stiffness(mesh: Any, stage: ParallelStage, turned: FloatArray) -> FloatArray:
    """Return the stiffness of one pair where ROSS puts its contact: linear in pressure angle."""
    pair = teeth_of(mesh_pairs(stage)[0])
    first, second = mesh.driving_gear.pr_angles_dict, mesh.driven_gear.pr_angles_dict
    step = (first["addendum"] - first["start_point"]) / mesh.contact_ratio
    moved = step * turned
    total = pair.compliances(pair.roll(np.zeros(1))).hertz + np.zeros(turned.shape)
    pressures = first["start_point"] + moved, second["addendum"] - mesh.gear_ratio * moved
    for tooth, pressure in zip(pair.teeth, pressures, strict=True):
        angle = np.tan(pressure) - tooth.base_half_angle
        total += sum(ToothBeam(tooth).compliances(angle))
        total += Foundation(tooth=tooth, arm="contact").compliance(angle)
    return np.asarray(1 / total)


#: Mesh harmonics up to 12 kHz.
HARMONICS = np.arange(1, int(12_000.0 * PERIOD_S) + 1)
#: Natural frequencies and loads of the grid for brute force: a tenth of a damping ratio and
#: 15 to 35 % apart.
FINE_GRID = (5000, 48)
REPEATS = 7
#: Lines that the time integration tries to tune to, the most energetic ones of each set.
TRIED_LINES = 5
#: Time constants of its ring-down that a harvester is integrated for, and steps of a mesh period.
RING_DOWNS, STEPS = 7.0, 1024
INERTIAL = InertialHarvester(
    mass_kg=5e-3, natural_frequency_hz=625.0, lowest_hz=300.0, highest_hz=20_000.0
)


def time_harvesting(progress: Progress | None = None, quick: bool = False) -> list[Row]:
    """Measure the tuning of gear pairs' lines and the optimum of a single tuning.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        One pair and a coarse grid.

    Returns
    -------
    list of dict
        ``case``, ``sets``, ``time_s`` and ``rival_time_s`` of one, ``rival``, ``ratio`` of times
        and ``power_ratio``, ours over the rival's.
    """
    steps: list[Callable[[], Row]] = [partial(_pairs_row, 1 if quick else 6)]
    steps += [partial(_optimum_row, own, quick) for own in (INERTIAL, built_in()[0])]
    return [step() for step in followed(steps, len(steps), progress)]


def _row(case: str, rival: str, pairs: Sequence[Sequence[Timing]]) -> Row:
    """Return the row of ours and the rival's timings, of which the results are powers."""
    ours, theirs = (float(np.mean([own[n].median_s for own in pairs])) for n in (0, 1))
    power = float(np.median([one.result / two.result for one, two in pairs]))
    row: Row = {"case": case, "sets": len(pairs), "time_s": ours, "rival": rival}
    return row | {"rival_time_s": theirs, "ratio": theirs / ours, "power_ratio": power}


def _pairs_row(sample: int) -> Row:
    problems = draw_sweep(sample, 0)
    tasks = [[partial(of, own) for of in (_tuned_power, _integrated)] for own in problems]
    timed = [interleaved(own, REPEATS) for own in tasks]
    rival = "time integration of pair and harvester (SciPy LSODA, exact steps)"
    return _row("lines of a gear pair and their tuning", rival, timed)


def _tuned_power(problem: HillProblem) -> float:
    """Mean power [W] of the harvester that is tuned to the lines of a pair."""
    lines = steady_state(problem, 1e-6).acceleration[1 : len(HARMONICS) + 1]
    own_hz = HARMONICS[: len(lines)] / PERIOD_S
    shaking = vibration_of_lines(own_hz, acceleration_ms2=2 * np.abs(lines))
    return float(tune_harvester(INERTIAL, shaking).power_w)


def _integrated(problem: HillProblem) -> float:
    """Best mean power [W] of one pair: integrate it, then a harvester at each strong line."""
    motion = shooter(Case(problem=problem), 9.0)()
    lines = np.fft.rfft(motion.acceleration, norm="forward")[1 : len(HARMONICS) + 1]
    lines *= problem.force_n / problem.mass_kg
    strongest = np.argsort(-np.abs(lines / HARMONICS[: len(lines)]))[:TRIED_LINES] + 1
    tried = [INERTIAL.retuned(n / PERIOD_S) for n in strongest.tolist()]
    return max(_marched(own.with_load(own.mechanical_damping_ratio), lines) for own in tried)


def _marched(harvester: InertialHarvester, lines: ComplexArray) -> float:
    """Mean power [W] in the last mesh period of a march through the ring-down.

    The strongest march there is for a linear harvester on a given motion: the exact step between
    samples with the acceleration linear in between, as a recursive filter in compiled code.
    """
    natural = 2 * math.pi * harvester.natural_frequency_hz
    total = harvester.mechanical_damping_ratio + harvester.electrical_damping_ratio
    velocity = ([-1.0, 0.0], [1.0, 2 * total * natural, natural**2])
    above, below, _ = scipy.signal.cont2discrete(velocity, PERIOD_S / STEPS, "foh")
    periods = math.ceil(RING_DOWNS / (total * natural) / PERIOD_S)
    push = np.tile(STEPS * np.fft.irfft(np.append(0j, lines), STEPS), periods)
    speed = scipy.signal.lfilter(np.ravel(above), below, push)[-STEPS:]
    damper = 2 * harvester.mass_kg * harvester.electrical_damping_ratio * natural
    return float(damper * np.mean(speed**2))


def _optimum_row(harvester: Harvester, quick: bool) -> Row:
    duty, (frequencies, loads) = _duty(), (200, 10) if quick else FINE_GRID
    brute = partial(_brute_force, harvester, duty, frequencies, loads)
    tasks = lambda: tune_harvester(harvester, duty).power_w, brute
    timed = interleaved(tasks, 1 if quick else REPEATS, NO_LIMIT_S)
    case = f"optimum of one tuning, {type(harvester).__name__}"
    return _row(case, f"brute force, {frequencies} frequencies x {loads} loads", [timed])


def _brute_force(harvester: Harvester, duty: Duty, frequencies: int, loads: int) -> float:
    """Largest power on a grid, all loads of a natural frequency at once."""
    low, high = harvester.frequency_range_hz
    grid = np.minimum(np.geomspace(low, high, frequencies), high).tolist()
    tuned = [harvester.retuned(frequency) for frequency in grid]
    powers = [mean_power_w(own, duty, np.geomspace(*own.load_range, loads)) for own in tuned]
    return float(np.max(powers))


def _duty() -> Duty:
    """Two operating points of five mesh harmonics with four sidebands to either side."""
    frequency = np.add.outer(540.0 * np.arange(1, 6), 18.0 * np.arange(-4, 5)).ravel()
    amplitude = np.random.default_rng(1).lognormal(-1, 1, frequency.size)
    full = vibration_of_lines(frequency, acceleration_ms2=amplitude)
    part = vibration_of_lines(0.6 * frequency, acceleration_ms2=0.5 * amplitude)
    return OperatingShare(vibration=full, share=0.8), OperatingShare(vibration=part, share=0.2)
