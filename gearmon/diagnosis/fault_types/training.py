"""Examples of every kind of fault on one machine, and a classifier trained on them.

Order lines that faults and errors of a machine add are computed once, ready to be superposed: every
mesh is solved for each thing that may be wrong with one tooth or with a whole gear, of a given
small size. To first order the lines of several teeth add, each delayed by its place in the turn, so
that any pattern w_j over the teeth of a gear gives the lines ``L_n W_n``, with L_n those of tooth 1
and ``W_n = sum_j w_j exp(-2 pi i n (j - 1)/z)``.

Each example is a machine of its own: errors of manufacture, path to the sensors, noise, load and
speed are drawn anew, so that nothing can be learned from them. What is wrong with it is drawn as
order lines to add to the sound ones; sizes are drawn over the whole range from what nothing shows
to what anybody hears, so that a classifier also learns how sure it can be. A healthy and a faulty
set of lines are measured through the same path, and condensed by the functions that also serve
recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.diagnosis.fault_types.kinds import KINDS, NONE, GearFeatures, focus_of, kind_features
from gearmon.diagnosis.hypotheses.turns import NEAR, departure_energy, turn_changes
from gearmon.diagnosis.law.machine import LevelDeviation
from gearmon.diagnosis.verdict import level_changes
from gearmon.errors import check_range
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.signatures.expected.baseline import faulty_lines
from gearmon.signatures.expected.mesh import MeshPlace
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, WheelLines, line_plan
from gearmon.signatures.measured.measurement import level_and_error_db
from gearmon.signatures.measured.reference import WheelPattern, tooth_counts

if TYPE_CHECKING:
    from gearmon.diagnosis.fault_types.classifier import KindClassifier

#: Loss of stiffness at which the lines of a damaged tooth, and of worn teeth, are computed.
LOSS = 0.1
#: Size at which the lines of errors are computed, in modules: 20 um at 2 mm.
SIZE = 0.01
#: A wobble that the load closes shows nothing; it is made larger, in modules.
_WOBBLES = (SIZE, 3 * SIZE, 9 * SIZE, 27 * SIZE)
_USUAL_MODULE_MM = 2.0
#: Kinds that take stiffness, the others are errors; and kinds of one tooth.
_LOSSES, _OF_A_TOOTH = ("crack", "pitting", "wear"), ("crack", "pitting", "pitch")
_TOLERANCE = 1e-2
# Lines are followed up to this multiple of the mesh.
_TOP = MESH_HARMONICS + 0.6
#: Scatter between healthy recordings that a level is taken to have at least [dB].
_BETWEEN_DB = 2.0
#: Points at which a path is drawn; between them it is straight.
_PATH_POINTS = 384
#: Longest echo, in periods of the highest order.
_LONGEST_ECHO = 80.0
_ECHOES = 16
# Waves of the curve by which another speed moves levels.
_WAVES = 6
#: Examples that a classifier is trained on unless another number is given.
EXAMPLES = 1600
#: Examples that a classifier can be trained on: ten a kind at least.
EXAMPLES_BETWEEN = (10 * len(KINDS), 1_000_000)
#: Multiples of the rotation that a loose shaft excites.
_LOOSE_MULTIPLES = 10
# effect of pitch errors, eccentricity and wobble of a sound gear over the lines of the perfect mesh
_ERROR_EFFECTS = ((0.03, 0.5), (0.03, 0.4), (0.003, 0.05))


def train_kinds(
    machine: MachineLike,
    seed: int = 0,
    count: int = EXAMPLES,
    operating: int = 0,
    progress: Callable[[float], None] | None = None,
) -> KindClassifier:
    """Train a classifier of the kinds of fault of one machine, without fault data.

    Parameters
    ----------
    machine : Machine, path or dict
        With the data that a baseline needs.
    seed : int, >= 0
        Of the examples and of the training.
    count : int, 80 to 1,000,000
        Examples, as many of each kind.
    operating : int
        Operating point, from 0.
    progress : callable, optional
        Called now and then with the share done, 0 to 1.

    Returns
    -------
    KindClassifier
        Trained on `kinds.NAMES`.

    Raises
    ------
    ArgumentError
        If the machine lacks data.

    Examples
    --------
    >>> kinds = gearmon.train_kinds(machine, count=80)
    >>> [str(kind) for kind in kinds.classes_][:3]
    ['distributed pitting', 'eccentricity', 'looseness']
    """
    from gearmon.diagnosis.fault_types.classifier import KindClassifier

    machine = load_machine(machine)
    check_range("count", count, *EXAMPLES_BETWEEN)
    drawn, made = examples(machine, seed, operating), []
    for number in range(count):
        made.append(next(drawn))
        if progress is not None:
            progress((number + 1) / count)
    rows, kinds = training_table(made)
    classifier = KindClassifier(random_state=seed).fit(rows, kinds)
    classifier.machine_ = tooth_counts(machine)
    return classifier


def training_table(made: list[Example]) -> tuple[FloatArray, NDArray[np.str_]]:
    """Return the feature rows in focus and their kinds."""
    rows = np.array([[*one.features[focus_of(one.features)].values()] for one in made])
    return rows, np.array([one.kind for one in made])


def examples(machine: Machine, seed: int, operating: int = 0) -> Iterator[Example]:
    """Draw examples without end, of every kind in turn.

    Parameters
    ----------
    machine, seed, operating
        See `train_kinds`.

    Yields
    ------
    Example
    """
    generator = np.random.default_rng([seed, 6])
    lines = MachineLines(machine, operating)
    for kind in cycle(KINDS):
        yield Example(lines, kind, generator)


class Example:
    """One machine drawn, what is wrong with it, and how it compares with the healthy one.

    Parameters
    ----------
    lines : MachineLines
        Of the machine.
    kind : str
        One of `KINDS`.
    generator : numpy.random.Generator

    Attributes
    ----------
    features : dict of (int, str) to dict
        What an analysis would have seen.
    kind : str
        Kind of the fault.
    gears : tuple of (int, str)
        Stage and gear of all gears that have it; empty for none.
    size : float
        Largest loss of stiffness, or effect of an error over the lines of the sound mesh.
    """

    def __init__(self, lines: MachineLines, kind: str, generator: np.random.Generator) -> None:
        errors, spread = _errors(lines, generator)
        sound, wrong, noise_db = lines.healthy + errors, [], 0.0
        if kind == "looseness":
            wrong = _loose(lines, spread, generator)
            noise_db = float(generator.uniform(0, 8))
        elif kind != NONE:
            index = int(generator.integers(len(lines.gears)))
            gear = lines.gears[index]
            wrong = [(gear.wheel, _DRAWN[kind](gear, float(spread[index]), generator))]
        load = float(np.clip(np.exp(generator.normal(0, 0.12)), 0.7, 1.4))
        moved = load * lines.healthy + errors
        for wheel, added in wrong:
            moved[wheel.stage - 1, wheel.lines] += load * added.stiffness + added.displacement
        sensors = _Sensors(lines, sound, generator)
        one = sensors.measured(sound)
        # another speed moves every line along the resonances, the same way in every channel: along
        # a smooth random curve of unit variance
        rate = generator.uniform(0, 2 * np.pi * (2.0 / sensors.top), _WAVES)
        size = generator.normal(size=_WAVES) + 1j * generator.normal(size=_WAVES)
        phase = generator.uniform(0, 2 * np.pi, _WAVES)
        curve = np.cos(np.outer(lines.plan.orders, rate) + phase) @ (size / np.sqrt(_WAVES))
        drift = np.exp(log_uniform(generator, 0.01, 0.1) * curve)
        two = sensors.measured(moved * drift, noise_db, strangers=kind == NONE)
        self.kind, self.features = kind, sensors.features(one, two)
        self.gears = tuple((wheel.stage, wheel.gear) for wheel, _ in wrong)
        self.size = max((added.size for _, added in wrong), default=0.0)


class GearLines:
    """What can be wrong with one gear, as lines at the multiples of its rotation.

    Errors come in units of their effect: 1 makes lines of the same rms as those of the sound mesh.

    Parameters
    ----------
    place : MeshPlace
        Of its mesh.
    wheel : WheelLines
        The gear and its place in the plan.
    sound : ndarray of complex
        Acceleration lines 0, 1, ... of the sound mesh [m/s2].

    Attributes
    ----------
    distance : ndarray of int, shape (lines,)
        Turns of the gear from the nearest mesh harmonic.
    added : mapping of str to ndarray of complex, shape (lines,)
        Acceleration lines by what is wrong [m/s2]: "crack" and "pitting" of tooth 1 and "wear" of
        all teeth per whole loss of stiffness; "eccentricity", "misalignment" and "profile" of the
        whole gear, of unit effect; "pitch" of tooth 1 standing back, of which a pattern over the
        teeth of unit variance has unit effect.
    turn : ndarray of float, shape (teeth,)
        Where the teeth are in the turn [rad].
    """

    def __init__(self, place: MeshPlace, wheel: WheelLines, sound: ComplexArray) -> None:
        module_mm = place.machine.stages[place.stage - 1].module_mm or _USUAL_MODULE_MM
        rms, half, of_ring = float(np.linalg.norm(sound)), wheel.teeth // 2, wheel.gear == "ring"

        def added(kind: str, modules: float = SIZE) -> ComplexArray:
            tooth = 1 if kind in _OF_A_TOOTH else "all"
            size = f"{LOSS}" if kind in _LOSSES else f"{1e3 * modules * module_mm}um"
            wrong = f"{kind}:{wheel.stage}:{wheel.gear}:{tooth}:{size}"
            lines = _lines(replace(place, mesh=int(of_ring)), [wrong], wheel.teeth)
            common = lines[:: wheel.teeth]
            common -= common if of_ring else sound[: len(common)]
            return _on(lines, wheel.number)

        def unit(lines: ComplexArray) -> ComplexArray:
            size = float(np.linalg.norm(lines))
            # what does not act (a gap that the load closes) leaves rounding errors
            return np.asarray(lines * (rms / size if size > 1e-6 * rms else 0.0))

        found = {kind: added(kind) / LOSS for kind in _LOSSES}
        found |= {kind: unit(added(kind)) for kind in ("pitch", "eccentricity", "profile")}
        # summed over z random teeth, z times the power of one
        found["pitch"] /= np.sqrt(wheel.teeth)
        for size in _WOBBLES:
            wobble = added("misalignment", size)
            if np.linalg.norm(wobble) > 0.05 * rms:
                break
        found["misalignment"] = unit(wobble)
        self.distance = (wheel.number + half) % wheel.teeth - half
        self.wheel, self.added = wheel, found
        self.turn = 2 * np.pi * np.arange(wheel.teeth) / wheel.teeth

    def by_tooth(self, kind: str, weight: FloatArray) -> ComplexArray:
        """Return the lines of a pattern over the teeth, from those of tooth 1."""
        around = np.fft.fft(weight)[self.distance % self.wheel.teeth]
        return np.asarray(self.added[kind] * around)

    def multiple(self, number: int, share: float, angle_rad: float) -> ComplexArray:
        """Return the lines of an error that repeats once or twice per turn, of unit effect.

        Parameters
        ----------
        number : {1, 2}
            1 for eccentricity, 2 for wobble.
        share : float, in [0, 1]
            Share of lines in which the error changes the contact of the teeth as well, and not only
            moves them: models and machines differ in that.
        angle_rad : float
            Of the gear.
        """
        whole = self.added["eccentricity" if number == 1 else "misalignment"]
        moved = self.by_tooth("pitch", np.sqrt(2.0) * np.cos(number * self.turn))
        turned = np.exp(1j * self.distance * angle_rad)
        return np.asarray((share * whole + (1 - share) * moved) * turned)


class MachineLines:
    """The lines of everything that can be wrong with the gears of a machine.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs.
    operating : int
        Operating point, from 0.

    Attributes
    ----------
    plan : LinePlan
        Orders and families.
    healthy : ndarray of complex, shape (stages, orders)
        Acceleration of each sound mesh at the operating point [m/s2].
    gears : tuple of GearLines
        Every gear.

    Raises
    ------
    ArgumentError
        If the machine lacks data.

    Notes
    -----
    Of a planetary set the ring's mesh adds to the mesh harmonics with phases that depend on the
    planets; faults of the ring are therefore taken not to change them.
    """

    def __init__(self, machine: Machine, operating: int = 0) -> None:
        train = kinematics(machine)
        top = _TOP * max(mesh.order for mesh in train.meshes)
        slowest = min(wheel.relative_order for mesh in train.meshes for wheel in mesh.wheels)
        self.plan = plan = line_plan(train, top, 0.5 * slowest)
        self.healthy = np.zeros((len(machine.stages), len(plan.orders)), dtype=np.complex128)
        gears: list[GearLines] = []
        for stage, own in enumerate(self.healthy, 1):
            place = MeshPlace(machine, stage, operating)
            sound = _lines(place)
            wheels = [wheel for wheel in plan.wheels if wheel.stage == stage]
            gears += [GearLines(place, wheel, sound) for wheel in wheels]
            for wheel in wheels[:1]:
                chosen = wheel.number % wheel.teeth == 0
                own[wheel.lines[chosen]] = _on(sound, wheel.number[chosen] // wheel.teeth)
        self.gears = tuple(gears)


def _lines(place: MeshPlace, wrong: Sequence[str] = (), teeth: int = 1) -> ComplexArray:
    """Return acceleration lines 0, 1, ... of the turn of a gear (of the mesh: 1 tooth)."""
    mesh_hz = kinematics(place.machine).mesh(place.stage).order * place.point.shaft1_hz
    (solved,) = faulty_lines(place.alone(), [place.alone(wrong)], _TOP * mesh_hz, _TOLERANCE)
    lines = np.zeros(int(np.ceil(_TOP * teeth)) + 1, dtype=np.complex128)
    lines[solved.number * (teeth // solved.period)] = 2 * solved.acceleration
    return lines


def _on(lines: ComplexArray, number: IntArray) -> ComplexArray:
    """Return lines by their numbers, 0 where there is none."""
    return np.append(lines, 0.0)[np.minimum(number, len(lines))]


def _errors(lines: MachineLines, generator: np.random.Generator) -> tuple[ComplexArray, FloatArray]:
    """Draw the errors of manufacture, and return their effect on each gear."""
    total = np.zeros_like(lines.healthy)
    spread = np.zeros(len(lines.gears))
    for index, gear in enumerate(lines.gears):
        pitch, runout, wobble = (log_uniform(generator, *ends) for ends in _ERROR_EFFECTS)
        weight = generator.normal(0, 1, gear.wheel.teeth)
        angle, other = generator.uniform(0, 2 * np.pi, 2)
        effect = pitch * gear.by_tooth("pitch", weight - weight.mean())
        effect += runout * gear.multiple(1, generator.uniform(), angle)
        effect += wobble * gear.multiple(2, 1.0, other) * (gear.distance != 0)
        total[gear.wheel.stage - 1, gear.wheel.lines] += effect
        spread[index] = np.hypot(pitch, runout)
    return total, spread


class _Added(NamedTuple):
    """Lines that a fault adds at the multiples of one gear's rotation [m/s2], and its size.

    The first do not grow with the load; the others do, and are those at the operating point. The
    size is the largest loss of stiffness, or the effect of an error over the lines of the sound
    mesh.
    """

    size: float
    displacement: ComplexArray
    stiffness: ComplexArray | float = 0.0


def log_uniform(generator: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform between those of two positive ends."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _teeth(gear: GearLines, spread: float, rng: np.random.Generator, most: int = 1) -> _Added:
    """Return a few damaged teeth: cracks, breakage, pits, some of them bent as well."""
    teeth, count = gear.wheel.teeth, int(rng.integers(min(2, most), most + 1))
    weight, bent = np.zeros(teeth), np.zeros(teeth)
    first, size = int(rng.integers(teeth)), log_uniform(rng, 0.04, 0.7)
    # two neighbours are hardly more than one
    scattered = count == 2 or rng.uniform() < 0.8
    places = (first + np.arange(count)) % teeth
    if scattered:
        places = rng.choice(teeth, count, replace=False)
    for step, tooth in enumerate(places.tolist()):
        weight[tooth] = size * (1.0 if step == 0 else rng.uniform(0.6, 1.0))
        if rng.uniform() < 0.3:
            bent[tooth] = spread * rng.uniform(0, 8) * size
    kind = "crack" if rng.uniform() < 0.65 else "pitting"
    return _Added(size, gear.by_tooth("pitch", bent), gear.by_tooth(kind, weight))


def _pitted(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return pits on most teeth, more on some than on others."""
    teeth, size = gear.wheel.teeth, log_uniform(rng, 0.03, 0.4)
    weight = size * np.exp(rng.normal(0, rng.uniform(0.2, 0.7), teeth))
    weight = np.minimum(weight, 0.8) * (rng.uniform(size=teeth) < rng.uniform(0.4, 1.0))
    rough = rng.normal(0, spread * rng.uniform(0, 0.5), teeth)
    return _Added(size, gear.by_tooth("pitch", rough), gear.by_tooth("pitting", weight))


def _worn(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return teeth that are worn alike, but for a little."""
    teeth, loss = gear.wheel.teeth, log_uniform(rng, 0.02, 0.3)
    uneven = loss * rng.normal(0, rng.uniform(0.0, 0.1), teeth)
    profile = log_uniform(rng, 0.1, 1.5)
    rough = rng.normal(0, 0.1 * spread * rng.uniform(), teeth)
    moved = profile * gear.added["profile"] + gear.by_tooth("pitch", rough)
    lost = loss * gear.added["wear"] + gear.by_tooth("crack", uneven - uneven.mean())
    return _Added(profile, moved, lost)


def _eccentric(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    size = min(spread * log_uniform(rng, 1.5, 15.0), 5.0)
    return _Added(size, size * gear.multiple(1, rng.uniform(), rng.uniform(0, 2 * np.pi)))


def _misaligned(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return a gear that wobbles on its shaft, and perhaps a shaft that stands askew."""
    size = min(log_uniform(rng, 0.08, 2.0) + 0.5 * spread, 5.0)
    lines = size * gear.multiple(2, rng.uniform(), rng.uniform(0, 2 * np.pi))
    askew = rng.uniform(0, 0.15) if rng.uniform() < 0.5 else 0.0
    return _Added(size, lines, askew * gear.added["wear"])


_DRAWN: dict[str, Callable[[GearLines, float, np.random.Generator], _Added]] = {
    "tooth damage": _teeth,
    "several teeth": partial(_teeth, most=5),
    "distributed pitting": _pitted,
    "wear": _worn,
    "eccentricity": _eccentric,
    "misalignment": _misaligned,
}


def _loose(
    lines: MachineLines, spread: FloatArray, rng: np.random.Generator
) -> list[tuple[WheelLines, _Added]]:
    """Return a loose shaft, which moves its gears with multiples of its rotation that fall slowly.

    Half orders lie on none of the lines that are compared.
    """
    on_shaft = np.array([gear.wheel.shaft or 0 for gear in lines.gears])
    shafts = np.unique(on_shaft[on_shaft > 0])
    own = on_shaft == shafts[int(rng.integers(len(shafts)))]
    multiple = np.arange(1, _LOOSE_MULTIPLES + 1)
    size = log_uniform(rng, 1.5, 15.0) * float(np.mean(spread[own]))
    share = multiple ** -rng.uniform(0.2, 1.2) * rng.uniform(0.5, 1.5, len(multiple))
    phase = rng.uniform(0, 2 * np.pi, len(multiple))
    found = []
    for index in np.flatnonzero(own).tolist():
        gear = lines.gears[index]
        weight = np.cos(np.outer(gear.turn, multiple) + phase) @ share
        weight *= min(size, 5.0) * rng.uniform(0.4, 1.0) / np.std(weight)
        found.append((gear.wheel, _Added(size, gear.by_tooth("pitch", weight))))
    return found


# A recording: levels of families with their standard errors [dB], patterns of gears.
_Measured = tuple[FloatArray, FloatArray, list[WheelPattern]]


class _Sensors:
    """Sensors on one machine: path, noise and range drawn, and what they make of its lines."""

    def __init__(self, lines: MachineLines, sound: ComplexArray, rng: np.random.Generator) -> None:
        self.lines, self.rng = lines, rng
        orders, channels = lines.plan.orders, int(rng.integers(1, 4))
        # a smooth random transfer function each: a few delayed echoes
        point, paths = np.linspace(0, orders[-1], _PATH_POINTS), []
        for _ in range(channels):
            longest = 2 * np.pi / orders[-1] * _LONGEST_ECHO * rng.uniform(0.05, 1.0)
            delay = rng.uniform(0, longest, _ECHOES)
            # modes of the housing ring on, ever more softly
            size = rng.normal(size=_ECHOES) + 1j * rng.normal(size=_ECHOES)
            size *= np.exp(-2.0 * delay / delay.max())
            paths.append(np.interp(orders, point, np.exp(-1j * np.outer(point, delay)) @ size))
        self.path = np.array(paths)
        # a mesh is heard through its own bearings: which one is louder is for the path to say
        rms = np.linalg.norm(sound, axis=1)
        self.loudness = 10 ** (rng.uniform(-25, 0, (channels, len(rms))) / 20) / rms
        power = np.sum(np.abs(self.path * (self.loudness @ sound)) ** 2, axis=1)
        self.variance = power * 10 ** (-rng.uniform(48, 75, channels) / 10)
        self.gain = np.exp(rng.normal(0, 0.4, channels))
        self.departure = log_uniform(rng, 0.002, 0.03)
        self.top = float(orders[-1] * rng.uniform(0.3, 1.0))

    def measured(
        self, lines: ComplexArray, noise_db: float = 0.0, *, strangers: bool = False
    ) -> _Measured:
        """Measure lines of the meshes, shape (stages, orders).

        Strangers are lines of something else, a bearing or the mains, that now and then fall on a
        few lines of the machine.
        """
        rng, plan, shape = self.rng, self.lines.plan, self.path.shape
        level = self.variance * 10 ** (noise_db / 10)
        variance = np.broadcast_to(level[:, None], shape)
        random = rng.normal(0, np.sqrt(0.5), (2, 2, *shape))
        first, second = random[:, 0] + 1j * random[:, 1]
        amplitude = self.path * (self.loudness @ lines) * (1 + self.departure * first)
        amplitude = self.gain[:, None] ** rng.integers(0, 2) * amplitude
        amplitude = amplitude + np.sqrt(variance) * second
        if strangers and rng.uniform() < 0.4:
            place = rng.integers(0, shape[1], int(rng.integers(1, 6)))
            typical = np.sqrt(np.median(np.abs(amplitude) ** 2, axis=1))
            size = log_uniform(rng, 1.0, 20.0) * typical
            phase = np.exp(2j * np.pi * rng.uniform(size=(shape[0], len(place))))
            amplitude[:, place] += size[:, None] * phase
        square = np.abs(amplitude) ** 2
        spread = np.sqrt(plan.by_family(variance**2 + 2 * variance * square))
        levels = level_and_error_db(plan.by_family(square - variance), spread)
        wheels, told = [], ("stage", "gear", "teeth", "order", "number", "mesh")
        for wheel in (gear.wheel for gear in self.lines.gears):
            known = {name: getattr(wheel, name) for name in told}
            known |= {"amplitude": amplitude[:, wheel.lines], "variance": variance[:, wheel.lines]}
            wheels.append(WheelPattern(**known).only(wheel.number * wheel.order < self.top))
        # of the gears of which more than a mesh order is in range
        return *levels, [own for own in wheels if len(own.number) > own.teeth]

    def features(self, one: _Measured, two: _Measured) -> GearFeatures:
        """Compare families of lines, channel by channel, turns of the gears, single sidebands."""
        (before, error_db, known_wheels), (level_db, new_error_db, wheels) = one, two
        after = level_db + self.rng.normal(0, self.rng.uniform(0.3, 1.5), level_db.shape)
        families, orders = self.lines.plan.families, self.lines.plan.orders
        inside = orders[[max(family.lines) for family in families]] < self.top
        rest = np.where(inside, after - before, np.nan)
        sigma = np.sqrt(error_db**2 + new_error_db**2 + _BETWEEN_DB**2)
        deviation = LevelDeviation(before, rest, sigma, np.zeros(len(after)))
        changes = level_changes(deviation, [*map(str, range(len(after)))], families)
        near = NEAR if self.rng.uniform() < 0.5 else 0
        # what the two recordings do not share beyond their lines fills all of the turn
        floor, energies = log_uniform(self.rng, 0.003, 0.3), {}
        for known, own in zip(known_wheels, wheels, strict=True):
            energy = departure_energy(own, known, near)
            raised = energy + floor * energy.mean()
            energies[own.stage, own.gear] = raised / np.median(raised)
        # a caller may have families of lines only
        sidebands = {} if self.rng.uniform() < 0.1 else turn_changes(wheels, [known_wheels])
        return kind_features(changes, energies, sidebands)
