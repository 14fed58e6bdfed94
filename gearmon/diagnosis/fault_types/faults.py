"""What may be wrong with a machine, kind by kind, as order lines to add to the sound ones.

Sizes are drawn over the whole range from what nothing shows to what anybody hears, so that a
classifier also learns how sure it can be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.fault_types.features import NONE
from gearmon.diagnosis.fault_types.lines import GearLines, MachineLines

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Multiples of the rotation that a loose shaft excites.
_LOOSE_MULTIPLES = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class Wrong:
    """What a fault adds to the lines of a machine.

    Parameters
    ----------
    stiffness : ndarray of complex, shape (stages, orders)
        What grows with the load, at the operating point [m/s2].
    displacement : ndarray of complex, shape (stages, orders)
        What does not [m/s2].
    gears : tuple of (int, str)
        Stage and gear of all gears that have the fault.
    size : float
        Largest loss of stiffness, or effect of an error over the lines of the sound mesh.
    noise_db : float
        Rise of the noise between the lines [dB].
    """

    stiffness: ComplexArray
    displacement: ComplexArray
    gears: tuple[tuple[int, str], ...]
    size: float
    noise_db: float = 0.0


def draw_wrong(
    lines: MachineLines, kind: str, spread: FloatArray, generator: np.random.Generator
) -> Wrong:
    """Draw a fault of one kind: gear, teeth, size.

    Parameters
    ----------
    lines : MachineLines
        Of the machine.
    kind : str
        One of `KINDS`.
    spread : ndarray of float, shape (gears,)
        Effect of the errors of manufacture of each gear; an eccentricity is as many times that of
        a sound gear.
    generator : numpy.random.Generator

    Notes
    -----
    A loose shaft is taken to move its gears with ten multiples of its rotation that fall slowly,
    and to lift the noise; half orders lie on none of the lines that are compared.
    """
    stiffness = np.zeros_like(lines.healthy)
    displacement = np.zeros_like(stiffness)
    if kind == NONE:
        return Wrong(stiffness=stiffness, displacement=displacement, gears=(), size=0.0)
    if kind == "looseness":
        return _loose(lines, spread, generator)
    index = int(generator.integers(len(lines.gears)))
    gear = lines.gears[index]
    added = _DRAWN[kind](gear, float(spread[index]), generator)
    stiffness[gear.wheel.stage - 1, gear.wheel.lines] = added.stiffness
    displacement[gear.wheel.stage - 1, gear.wheel.lines] = added.displacement
    own = ((gear.wheel.stage, gear.wheel.gear),)
    return Wrong(stiffness=stiffness, displacement=displacement, gears=own, size=added.size)


def log_uniform(generator: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform between those of two positive ends."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Added:
    """Lines that a fault adds at the multiples of one gear's rotation."""

    stiffness: ComplexArray
    displacement: ComplexArray
    size: float


def _teeth(gear: GearLines, count: int, spread: float, rng: np.random.Generator) -> _Added:
    """Return a few damaged teeth: cracks, breakage, pits, some of them bent as well."""
    teeth = gear.wheel.teeth
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
    return _Added(
        stiffness=gear.by_tooth(kind, weight),
        displacement=gear.by_tooth(gear.pitch, bent),
        size=size,
    )


def _one_tooth(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    return _teeth(gear, 1, spread, rng)


def _several(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    return _teeth(gear, int(rng.integers(2, 6)), spread, rng)


def _pitted(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return pits on most teeth, more on some than on others."""
    teeth, size = gear.wheel.teeth, log_uniform(rng, 0.03, 0.4)
    weight = size * np.exp(rng.normal(0, rng.uniform(0.2, 0.7), teeth))
    weight = np.minimum(weight, 0.8) * (rng.uniform(size=teeth) < rng.uniform(0.4, 1.0))
    rough = rng.normal(0, spread * rng.uniform(0, 0.5), teeth)
    return _Added(
        stiffness=gear.by_tooth(gear.pitting, weight),
        displacement=gear.by_tooth(gear.pitch, rough),
        size=size,
    )


def _worn(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return teeth that are worn alike, but for a little."""
    teeth, loss = gear.wheel.teeth, log_uniform(rng, 0.02, 0.3)
    uneven = loss * rng.normal(0, rng.uniform(0.0, 0.1), teeth)
    profile = log_uniform(rng, 0.1, 1.5)
    return _Added(
        stiffness=loss * gear.wear + gear.by_tooth(gear.crack, uneven - uneven.mean()),
        displacement=profile * gear.profile
        + gear.by_tooth(gear.pitch, rng.normal(0, 0.1 * spread * rng.uniform(), teeth)),
        size=profile,
    )


def _eccentric(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    size = min(spread * log_uniform(rng, 1.5, 15.0), 5.0)
    lines = size * gear.multiple(1, rng.uniform(), rng.uniform(0, 2 * np.pi))
    return _Added(stiffness=np.zeros_like(lines), displacement=lines, size=size)


def _misaligned(gear: GearLines, spread: float, rng: np.random.Generator) -> _Added:
    """Return a gear that wobbles on its shaft, and perhaps a shaft that stands askew."""
    size = min(log_uniform(rng, 0.08, 2.0) + 0.5 * spread, 5.0)
    lines = size * gear.multiple(2, rng.uniform(), rng.uniform(0, 2 * np.pi))
    askew = rng.uniform(0, 0.15) if rng.uniform() < 0.5 else 0.0
    return _Added(stiffness=askew * gear.wear, displacement=lines, size=size)


_DRAWN: dict[str, Callable[[GearLines, float, np.random.Generator], _Added]] = {
    "tooth damage": _one_tooth,
    "several teeth": _several,
    "distributed pitting": _pitted,
    "wear": _worn,
    "eccentricity": _eccentric,
    "misalignment": _misaligned,
}


def _loose(lines: MachineLines, spread: FloatArray, rng: np.random.Generator) -> Wrong:
    shafts = sorted({gear.wheel.shaft for gear in lines.gears if gear.wheel.shaft is not None})
    chosen = shafts[int(rng.integers(len(shafts)))]
    own = [i for i, gear in enumerate(lines.gears) if gear.wheel.shaft == chosen]
    displacement = np.zeros_like(lines.healthy)
    multiple = np.arange(1, _LOOSE_MULTIPLES + 1)
    size = log_uniform(rng, 1.5, 15.0) * float(np.mean(spread[own]))
    share = multiple ** -rng.uniform(0.2, 1.2) * rng.uniform(0.5, 1.5, len(multiple))
    phase = rng.uniform(0, 2 * np.pi, len(multiple))
    for index in own:
        gear = lines.gears[index]
        turn = 2 * np.pi * np.arange(gear.wheel.teeth) / gear.wheel.teeth
        weight = np.cos(np.outer(turn, multiple) + phase) @ share
        weight *= min(size, 5.0) * rng.uniform(0.4, 1.0) / np.std(weight)
        displacement[gear.wheel.stage - 1, gear.wheel.lines] += gear.by_tooth(gear.pitch, weight)
    return Wrong(
        stiffness=np.zeros_like(displacement),
        displacement=displacement,
        gears=tuple((lines.gears[i].wheel.stage, lines.gears[i].wheel.gear) for i in own),
        size=size,
        noise_db=float(rng.uniform(0, 8)),
    )
