"""Errors that are not damage, and profile that damage has taken: displacement excitation e(t).

An error moves the flanks along the line of action by missing material, pair by pair. Pairs share
the load as their stiffness, so the mesh sees the mean of their errors, weighted by stiffness:
``m z'' + c z' + k(t) [z - e(t)] = F``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import ArgumentError, check_range, nearest_name
from gearmon.gears.faults import GEARS, Fault
from gearmon.gears.missing_material import (
    ERROR_KINDS,
    GearError,
    PairError,
    error_of,
    profile_lost_by,
)
from gearmon.gears.pairs import MeshPair
from gearmon.gears.panels import ComplexArray, FloatArray, gauss
from gearmon.gears.stiffness import MeshStiffness

#: Slices of the face width of helical gears.
SLICES = 12
#: Longest period that is sampled [mesh periods].
LONGEST_PERIOD = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Excitation:
    """Displacement excitation of a mesh.

    Parameters
    ----------
    stiffness : MeshStiffness
        Shares the errors among the pairs in contact.
    errors : tuple of PairError
    warnings : tuple of str
    """

    stiffness: MeshStiffness
    errors: tuple[PairError, ...]
    warnings: tuple[str, ...] = ()

    @property
    def period_mesh(self) -> int:
        """True period [mesh periods], of errors and stiffness together."""
        return math.lcm(self.stiffness.period_mesh, *(error.teeth for error in self.errors))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return e [m] at mesh phases, any shape; positive where material is missing."""
        x = np.asarray(phase, dtype=np.float64)
        force, stiffness = np.zeros(x.shape), np.zeros(x.shape)
        for place, weight in self._slices:
            local = x - place * self.stiffness.overlap_ratio
            for n in range(math.ceil(self.stiffness.contact_ratio - 1e-12)):
                entry = np.floor(local).astype(np.int64) - n
                passed = local - entry
                load = weight * self._load(entry, passed, place)
                force += load * sum(error.at(entry, passed, x) for error in self.errors)
                stiffness += load
        # without any load nothing is transmitted either
        return np.asarray(force / np.where(stiffness > 0, stiffness, 1.0))

    def sample(self, points_per_mesh: int) -> FloatArray:
        """Return e [m] over the true period, at the phases i/points_per_mesh.

        Raises
        ------
        ArgumentError
            If the true period is longer than 20,000 mesh periods.
        """
        check_range("points_per_mesh", points_per_mesh, 1, 100_000)
        if self.period_mesh > LONGEST_PERIOD:
            raise ArgumentError(
                f"the errors repeat after {self.period_mesh} mesh periods only, more than "
                f"{LONGEST_PERIOD}; ask for the errors of one gear at a time"
            )
        return self.at(np.arange(self.period_mesh * points_per_mesh) / points_per_mesh)

    def harmonics(self, count: int, points_per_mesh: int = 64) -> ComplexArray:
        """Return e_0 ... e_count [m] of ``e = e_0 + sum_r (e_r exp(2 pi i r phase/P) + conj)``.

        From samples: orders near half of `points_per_mesh` carry the folded tail of the jumps at
        the ends of contact.
        """
        samples = self.sample(points_per_mesh)
        if 2 * count >= len(samples):
            raise ArgumentError(f"count={count} must be below {len(samples) // 2}")
        return np.asarray(np.fft.rfft(samples)[: count + 1] / len(samples))

    @cached_property
    def _slices(self) -> list[tuple[float, float]]:
        if self.stiffness.overlap_ratio == 0:
            parts = {0.0, 1.0}
            for train in self.stiffness.pulses:
                for term in train.terms:
                    parts |= {term.face_start, term.face_end}
            edges = sorted(parts)
            widths = np.diff(edges)
            return [(a + 0.5 * w, w) for a, w in zip(edges[:-1], widths.tolist(), strict=True)]
        nodes, weights, _ = gauss(SLICES)
        return list(zip((0.5 + 0.5 * nodes).tolist(), (0.5 * weights).tolist(), strict=True))

    def _load(self, entry: NDArray[np.int64], passed: FloatArray, place: float) -> FloatArray:
        """Return the stiffness of a slice of the pairs that entered at `entry`."""
        total = np.asarray(
            sum(term.weight * term.pulse.value(passed) for term in self.stiffness.healthy.terms)
        )
        for train in self.stiffness.pulses:
            for term in train.terms:
                if not term.face_start <= place < term.face_end:
                    continue
                hurt = (entry - round(term.offset)) % train.period_mesh == 0
                if hurt.any():
                    total = total + np.where(hurt, term.weight * term.pulse.value(passed), 0.0)
        return np.asarray(np.maximum(total, 0.0))


def displacement_excitation(
    pair: MeshPair,
    stiffness: MeshStiffness,
    errors: Iterable[GearError] = (),
    faults: Iterable[Fault] = (),
) -> Excitation:
    """Return the displacement excitation of a mesh by errors and by profile lost to damage.

    Parameters
    ----------
    pair : MeshPair
    stiffness : MeshStiffness
        Of this mesh, with its faults.
    errors : iterable of GearError
        Of this stage; those of gears of other meshes are left aside.
    faults : iterable of Fault
        Missing teeth and spalls across the whole face move the flanks too.

    Raises
    ------
    ArgumentError
        If a gear has no such tooth.
    """
    names = [member.name for member in pair.members]
    found: list[PairError] = []
    notes: list[str] = []
    for error in errors:
        if error.gear in names:
            found.append(error_of(error, pair, names.index(error.gear)))
        else:
            notes.append(f"error {error} does not act in the {pair.name} mesh")
    for fault in faults:
        if fault.gear in names and not fault.is_loss:
            found += profile_lost_by(fault, pair, names.index(fault.gear))
    return Excitation(stiffness=stiffness, errors=tuple(found), warnings=tuple(notes))


def parse_error(text: str) -> GearError:
    """Read an error of a gear written as ``KIND:STAGE:GEAR:TOOTH:SIZE``.

    Parameters
    ----------
    text : str
        SIZE in um or mm; TOOTH is a number or ``all``: ``eccentricity:1:pinion:all:20um``,
        ``pitch:1:gear:7:8um``.

    Raises
    ------
    ArgumentError
        If the text is not of this form.

    Examples
    --------
    >>> round(parse_error("eccentricity:1:pinion:all:20um").size_m, 9)
    2e-05
    """
    syntax = "KIND:STAGE:GEAR:TOOTH:SIZE, such as eccentricity:1:pinion:all:20um"
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 5:
        raise ArgumentError(f"error {text!r} has {len(parts)} parts and not 5: {syntax}")
    kind, stage, gear, tooth, size = parts
    for name, word, known in (("error kind", kind, tuple(ERROR_KINDS)), ("gear", gear, GEARS)):
        if word not in known:
            near = nearest_name(word, known)
            hint = f"; did you mean {near}?" if near else ""
            raise ArgumentError(f"{name} {word!r} is not one of {', '.join(known)}{hint}")
    scale = {"um": 1e-6, "mm": 1e-3}.get(size[-2:])
    try:
        if scale is None:
            raise ValueError
        return GearError(
            kind=kind,
            stage=int(stage),
            gear=gear,
            tooth=None if tooth == "all" else int(tooth),
            size_m=scale * float(size[:-2]),
        )
    except ArgumentError:
        raise
    except ValueError:
        raise ArgumentError(
            f"error {text!r}: STAGE and TOOTH must be whole numbers and SIZE a number in um or mm: "
            f"{syntax}"
        ) from None
