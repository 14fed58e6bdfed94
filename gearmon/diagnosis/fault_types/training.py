"""Examples of every kind of fault on one machine, and a classifier trained on them.

Each example is a machine of its own: errors of manufacture, path to the sensors, noise, load and
speed are drawn anew, so that nothing can be learned from them. A healthy and a faulty set of order
lines are superposed, measured through the same path, and condensed by the functions that also serve
recordings.

What is wrong with a machine is drawn as order lines to add to the sound ones. Sizes are drawn over
the whole range from what nothing shows to what anybody hears, so that a classifier also learns how
sure it can be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.diagnosis.fault_types.features import (
    KINDS,
    NAMES,
    NONE,
    FeatureVector,
    TurnEnergy,
    kind_features,
)
from gearmon.diagnosis.fault_types.lines import GearLines, MachineLines, machine_lines
from gearmon.diagnosis.hypotheses.own_teeth import NEAR, departure_energy
from gearmon.diagnosis.hypotheses.runout import TurnChange, turn_changes
from gearmon.diagnosis.results import Change
from gearmon.errors import check_range
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.signatures.measured.reference import WheelPattern, tooth_counts

#: Multiples of the rotation that a loose shaft excites.
_LOOSE_MULTIPLES = 10


class _Added(NamedTuple):
    """Lines that a fault adds at the multiples of one gear's rotation [m/s2], and its size.

    The first grow with the load, and are those at the operating point; the others do not. The size
    is the largest loss of stiffness, or the effect of an error over the lines of the sound mesh.
    """

    stiffness: ComplexArray
    displacement: ComplexArray
    size: float


def _wrong(
    lines: MachineLines, kind: str, spread: FloatArray, rng: np.random.Generator
) -> dict[int, _Added]:
    """Draw a fault of one kind: what it adds to each gear that has it.

    `spread` is the effect of the errors of manufacture of each gear; an eccentricity is as many
    times that of a sound gear.
    """
    if kind == NONE:
        return {}
    if kind == "looseness":
        return _loose(lines, spread, rng)
    index = int(rng.integers(len(lines.gears)))
    return {index: _DRAWN[kind](lines.gears[index], float(spread[index]), rng)}


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
    places = rng.choice(teeth, min(count, teeth), replace=False) if scattered else None
    for step in range(count):
        tooth = int(places[step % len(places)]) if places is not None else (first + step) % teeth
        weight[tooth] = size * (1.0 if step == 0 else rng.uniform(0.6, 1.0))
        if rng.uniform() < 0.3:
            bent[tooth] = spread * rng.uniform(0, 8) * size
    kind = gear.crack if rng.uniform() < 0.65 else gear.pitting
    return _Added(gear.by_tooth(kind, weight), gear.by_tooth(gear.pitch, bent), size)


def _pitted(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return pits on most teeth, more on some than on others."""
    teeth, size = gear.wheel.teeth, log_uniform(rng, 0.03, 0.4)
    weight = size * np.exp(rng.normal(0, rng.uniform(0.2, 0.7), teeth))
    weight = np.minimum(weight, 0.8) * (rng.uniform(size=teeth) < rng.uniform(0.4, 1.0))
    rough = rng.normal(0, spread * rng.uniform(0, 0.5), teeth)
    return _Added(gear.by_tooth(gear.pitting, weight), gear.by_tooth(gear.pitch, rough), size)


def _worn(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return teeth that are worn alike, but for a little."""
    teeth, loss = gear.wheel.teeth, log_uniform(rng, 0.02, 0.3)
    uneven = loss * rng.normal(0, rng.uniform(0.0, 0.1), teeth)
    profile = log_uniform(rng, 0.1, 1.5)
    rough = rng.normal(0, 0.1 * spread * rng.uniform(), teeth)
    return _Added(
        loss * gear.wear + gear.by_tooth(gear.crack, uneven - uneven.mean()),
        profile * gear.profile + gear.by_tooth(gear.pitch, rough),
        profile,
    )


def _eccentric(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    size = min(spread * log_uniform(rng, 1.5, 15.0), 5.0)
    lines = size * gear.multiple(1, rng.uniform(), rng.uniform(0, 2 * np.pi))
    return _Added(np.zeros_like(lines), lines, size)


def _misaligned(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return a gear that wobbles on its shaft, and perhaps a shaft that stands askew."""
    size = min(log_uniform(rng, 0.08, 2.0) + 0.5 * spread, 5.0)
    lines = size * gear.multiple(2, rng.uniform(), rng.uniform(0, 2 * np.pi))
    askew = rng.uniform(0, 0.15) if rng.uniform() < 0.5 else 0.0
    return _Added(askew * gear.wear, lines, size)


_DRAWN: dict[str, Callable[[GearLines, float, np.random.Generator], _Added]] = {
    "tooth damage": _teeth,
    "several teeth": partial(_teeth, most=5),
    "distributed pitting": _pitted,
    "wear": _worn,
    "eccentricity": _eccentric,
    "misalignment": _misaligned,
}


def _loose(lines: MachineLines, spread: FloatArray, rng: np.random.Generator) -> dict[int, _Added]:
    """Return a loose shaft, which moves its gears with multiples of its rotation that fall slowly.

    Half orders lie on none of the lines that are compared.
    """
    shafts = sorted({gear.wheel.shaft for gear in lines.gears if gear.wheel.shaft is not None})
    chosen = shafts[int(rng.integers(len(shafts)))]
    own = [i for i, gear in enumerate(lines.gears) if gear.wheel.shaft == chosen]
    multiple = np.arange(1, _LOOSE_MULTIPLES + 1)
    size = log_uniform(rng, 1.5, 15.0) * float(np.mean(spread[own]))
    share = multiple ** -rng.uniform(0.2, 1.2) * rng.uniform(0.5, 1.5, len(multiple))
    phase = rng.uniform(0, 2 * np.pi, len(multiple))
    found = {}
    for index in own:
        gear = lines.gears[index]
        turn = 2 * np.pi * np.arange(gear.wheel.teeth) / gear.wheel.teeth
        weight = np.cos(np.outer(turn, multiple) + phase) @ share
        weight *= min(size, 5.0) * rng.uniform(0.4, 1.0) / np.std(weight)
        moved = gear.by_tooth(gear.pitch, weight)
        found[index] = _Added(np.zeros_like(moved), moved, size)
    return found


if TYPE_CHECKING:
    from gearmon.diagnosis.fault_types.classifier import KindClassifier


#: Scatter between healthy recordings that a level is taken to have at least [dB].
_BETWEEN_DB = 2.0
_TINY = np.finfo(float).tiny
#: Points at which a path is drawn; between them it is straight.
_PATH_POINTS = 384
#: Longest echo, in periods of the highest order.
_LONGEST_ECHO = 80.0
_ECHOES = 16
#: Examples that a classifier is trained on unless another number is given.
EXAMPLES = 1600
#: Examples that a classifier can be trained on: ten a kind at least.
EXAMPLES_BETWEEN = (10 * len(KINDS), 1_000_000)


@dataclass(frozen=True, kw_only=True, eq=False)
class Example:
    """A simulated comparison with a healthy machine, and what was wrong.

    Parameters
    ----------
    features : FeatureVector
        What an analysis would have seen.
    kind : str
        Kind of the fault.
    gears : tuple of (int, str)
        Stage and gear of all gears that have it; empty for none.
    size : float
        Largest loss of stiffness, or effect of an error over the lines of the sound mesh.
    """

    features: FeatureVector
    kind: str
    gears: tuple[tuple[int, str], ...]
    size: float


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
        Trained on `features.NAMES`.

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
    rows, kinds = training_table(examples(machine, seed, count, operating, progress))
    classifier = KindClassifier(random_state=seed).fit(rows, kinds)
    classifier.machine_ = tooth_counts(machine)
    return classifier


def training_table(made: list[Example]) -> tuple[FloatArray, NDArray[np.str_]]:
    """Return the feature rows in focus and their kinds."""
    rows = np.array([one.features.values[one.features.focus] for one in made])
    return rows.reshape(len(made), len(NAMES)), np.array([one.kind for one in made])


def examples(
    machine: Machine,
    seed: int,
    count: int,
    operating: int = 0,
    progress: Callable[[float], None] | None = None,
) -> list[Example]:
    """Draw examples, of every kind in turn.

    Parameters
    ----------
    machine, seed, count, operating, progress
        See `train_kinds`.

    Returns
    -------
    list of Example
    """
    generator = np.random.default_rng([seed, 6])
    lines = machine_lines(machine, operating)
    made = []
    for number in range(count):
        made.append(draw_example(lines, KINDS[number % len(KINDS)], generator))
        if progress is not None:
            progress((number + 1) / count)
    return made


def draw_example(lines: MachineLines, kind: str, generator: np.random.Generator) -> Example:
    """Draw one machine, what is wrong with it, and two recordings.

    Parameters
    ----------
    lines : MachineLines
        Of the machine.
    kind : str
        One of `KINDS`.
    generator : numpy.random.Generator
    """
    errors, spread = _errors(lines, generator)
    wrong = _wrong(lines, kind, spread, generator)
    noise_db = float(generator.uniform(0, 8)) if kind == "looseness" else 0.0
    load = float(np.clip(np.exp(generator.normal(0, 0.12)), 0.7, 1.4))
    moved = load * lines.healthy + errors
    for index, added in wrong.items():
        wheel = lines.gears[index].wheel
        moved[wheel.stage - 1, wheel.lines] += load * added.stiffness + added.displacement
    view = _View.drawn(lines, lines.healthy + errors, generator)
    one = view.measured(lines.healthy + errors, generator, 0.0)
    # another speed moves every line along the resonances, the same way in every channel
    curve = _smooth(lines.plan.orders, generator, 2.0 / view.top)
    drift = np.exp(log_uniform(generator, 0.01, 0.1) * curve)
    two = view.measured(moved * drift, generator, noise_db)
    if kind == NONE and generator.uniform() < 0.4:
        two = _with_strange_lines(two, generator)
    features = kind_features(
        _changes(lines, view, one, two, generator), *_wheels(lines, view, one, two, generator)
    )
    wheels = [lines.gears[index].wheel for index in wrong]
    return Example(
        features=features,
        kind=kind,
        gears=tuple((wheel.stage, wheel.gear) for wheel in wheels),
        size=max((added.size for added in wrong.values()), default=0.0),
    )


def _errors(lines: MachineLines, generator: np.random.Generator) -> tuple[ComplexArray, FloatArray]:
    """Draw the errors of manufacture, and return their effect on each gear."""
    total = np.zeros_like(lines.healthy)
    spread = np.zeros(len(lines.gears))
    for index, gear in enumerate(lines.gears):
        pitch, runout, wobble = (log_uniform(generator, *ends) for ends in _ERROR_EFFECTS)
        weight = generator.normal(0, 1, gear.wheel.teeth)
        angle, other = generator.uniform(0, 2 * np.pi, 2)
        total[gear.wheel.stage - 1, gear.wheel.lines] += (
            pitch * gear.by_tooth(gear.pitch, weight - weight.mean())
            + runout * gear.multiple(1, generator.uniform(), angle)
            + wobble * gear.turned(gear.wobble, other) * (gear.distance != 0)
        )
        spread[index] = np.hypot(pitch, runout)
    return total, spread


# effect of pitch errors, eccentricity and wobble of a sound gear over the lines of the perfect mesh
_ERROR_EFFECTS = ((0.03, 0.5), (0.03, 0.4), (0.003, 0.05))


class _View(NamedTuple):
    """What the sensors are like: path, noise, range."""

    path: ComplexArray
    loudness: FloatArray
    gain: FloatArray
    variance: FloatArray
    departure: float
    top: float

    @classmethod
    def drawn(cls, lines: MachineLines, sound: ComplexArray, rng: np.random.Generator) -> _View:
        orders, channels = lines.plan.orders, int(rng.integers(1, 4))
        path = np.array([_echoes(orders, rng) for _ in range(channels)])
        # a mesh is heard through its own bearings: which one is louder is for the path to say
        rms = np.linalg.norm(sound, axis=1)
        loudness = 10 ** (rng.uniform(-25, 0, (channels, len(rms))) / 20) / rms
        power = np.sum(np.abs(path * (loudness @ sound)) ** 2, axis=1)
        variance = power * 10 ** (-rng.uniform(48, 75, channels) / 10)
        gain, departure = np.exp(rng.normal(0, 0.4, channels)), log_uniform(rng, 0.002, 0.03)
        top = float(orders[-1] * rng.uniform(0.3, 1.0))
        return cls(path, loudness, gain, variance, departure, top)

    def measured(self, lines: ComplexArray, rng: np.random.Generator, noise_db: float) -> _Measured:
        shape = self.path.shape
        variance = np.repeat((self.variance * 10 ** (noise_db / 10))[:, None], shape[1], axis=1)
        random = rng.normal(0, np.sqrt(0.5), (2, 2, *shape))
        first, second = random[:, 0] + 1j * random[:, 1]
        amplitude = self.path * (self.loudness @ lines) * (1 + self.departure * first)
        amplitude = self.gain[:, None] ** rng.integers(0, 2) * amplitude
        return _Measured(amplitude=amplitude + np.sqrt(variance) * second, variance=variance)


class _Measured(NamedTuple):
    """Lines as measured, shape (channels, orders), and their variance."""

    amplitude: ComplexArray
    variance: FloatArray


def _echoes(orders: FloatArray, rng: np.random.Generator) -> ComplexArray:
    """Return a smooth random transfer function: a few delayed echoes."""
    point = np.linspace(0, orders[-1], _PATH_POINTS)
    longest = 2 * np.pi / orders[-1] * _LONGEST_ECHO * rng.uniform(0.05, 1.0)
    delay = rng.uniform(0, longest, _ECHOES)
    # modes of the housing ring on, ever more softly
    size = rng.normal(size=_ECHOES) + 1j * rng.normal(size=_ECHOES)
    size *= np.exp(-2.0 * delay / delay.max())
    return np.asarray(np.interp(orders, point, np.exp(-1j * np.outer(point, delay)) @ size))


def _smooth(orders: FloatArray, rng: np.random.Generator, density: float) -> ComplexArray:
    """Return a smooth random curve of unit variance, complex."""
    count = 6
    rate = rng.uniform(0, 2 * np.pi * density, count)
    size = (rng.normal(size=count) + 1j * rng.normal(size=count)) / np.sqrt(count)
    return np.asarray(np.cos(np.outer(orders, rate) + rng.uniform(0, 2 * np.pi, count)) @ size)


def _with_strange_lines(measured: _Measured, rng: np.random.Generator) -> _Measured:
    """Let lines of something else, a bearing or the mains, fall on a few lines of the machine."""
    channels, orders = measured.amplitude.shape
    place = rng.integers(0, orders, int(rng.integers(1, 6)))
    typical = np.sqrt(np.median(np.abs(measured.amplitude) ** 2, axis=1))
    size = log_uniform(rng, 1.0, 20.0) * typical
    phase = np.exp(2j * np.pi * rng.uniform(size=(channels, len(place))))
    amplitude = measured.amplitude.copy()
    amplitude[:, place] += size[:, None] * phase
    return measured._replace(amplitude=amplitude)


def _changes(
    lines: MachineLines, view: _View, one: _Measured, two: _Measured, rng: np.random.Generator
) -> list[Change]:
    """Compare the families of lines, channel by channel."""
    before, before_scatter = _family_levels(lines, one)
    after, after_scatter = _family_levels(lines, two)
    after += rng.normal(0, rng.uniform(0.3, 1.5), after.shape)
    scatter = np.sqrt(before_scatter**2 + after_scatter**2 + _BETWEEN_DB**2)
    told = ("kind", "stage", "harmonic", "gear", "shaft")
    return [
        Change(
            channel=str(channel),
            family=family.name,
            **{name: getattr(family, name) for name in told},
            level_db=float(after[channel, column]),
            reference_db=float(before[channel, column]),
            scatter_db=float(scatter[channel, column]),
        )
        for column, family in enumerate(lines.plan.families)
        for channel in range(len(after))
        if lines.plan.orders[max(family.lines)] < view.top
    ]


def _family_levels(lines: MachineLines, measured: _Measured) -> tuple[FloatArray, FloatArray]:
    """Levels of the families and their standard errors, as of recordings [dB]."""
    size, variance = np.abs(measured.amplitude) ** 2, measured.variance
    power = (size - variance) @ lines.members
    spread = np.sqrt((variance**2 + 2 * variance * size) @ lines.members)
    shown = np.maximum(power, np.maximum(spread, np.finfo(float).tiny))
    return 10 * np.log10(shown), 10 / np.log(10) * np.minimum(spread / shown, 1.0)


def _wheels(
    lines: MachineLines, view: _View, one: _Measured, two: _Measured, rng: np.random.Generator
) -> tuple[list[TurnEnergy], tuple[TurnChange, ...]]:
    """Look around the turn of every gear, and at its single sidebands."""
    pairs = [(_pattern(g, view, one), _pattern(g, view, two)) for g in lines.gears]
    kept = [(old, new) for old, new in pairs if len(new.number) > new.teeth]
    near = NEAR if rng.uniform() < 0.5 else 0
    # what the two recordings do not share beyond their lines fills all of the turn
    floor = log_uniform(rng, 0.003, 0.3)
    shapes = [
        TurnEnergy(new.stage, new.gear, _raised(departure_energy(new, old, near), floor))
        for old, new in kept
    ]
    rows = range(len(view.path))
    if rng.uniform() < 0.1:  # a caller may have families of lines only
        return shapes, ()
    turns = turn_changes([new for _, new in kept], rows, [[old for old, _ in kept]], rows)
    return shapes, turns


def _raised(energy: FloatArray, share: float) -> FloatArray:
    raised = energy + share * energy.mean()
    return np.asarray(raised / np.median(raised))


def _pattern(gear: GearLines, view: _View, measured: _Measured) -> WheelPattern:
    wheel = gear.wheel
    inside = wheel.number * wheel.order < view.top
    place = wheel.lines[inside]
    return WheelPattern(
        stage=wheel.stage,
        gear=wheel.gear,
        teeth=wheel.teeth,
        order=wheel.order,
        number=wheel.number[inside],
        mesh=wheel.mesh[inside],
        amplitude=measured.amplitude[:, place],
        variance=measured.variance[:, place],
    )
