"""Errors that are not damage, and profile that damage has taken: displacement excitation e(t).

An error moves the flanks along the line of action by missing material, pair by pair. Pairs share
the load as their stiffness, so the mesh sees the mean of their errors, weighted by stiffness:
``m z'' + c (z - e)' + k(t) (z - e) = F``. What moves all pairs alike (eccentricity, wobble) needs
no sharing. What eccentricity, cumulative pitch error and misalignment do to the stiffness itself is
in `modulation`; the sharing of the errors of single flanks is that of the stiffness without it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gearmon.errors import ArgumentError, check_range, nearest_name
from gearmon.gears.error_windows import FlankExcitation
from gearmon.gears.faults import GEARS, KINDS, Fault, parse_fault
from gearmon.gears.missing_material import (
    ERROR_KINDS,
    FlankError,
    GearError,
    TurningError,
    error_of,
    profile_lost_by,
)
from gearmon.gears.pairs import MeshPair
from gearmon.gears.panels import ComplexArray, FloatArray
from gearmon.gears.stiffness import MeshStiffness

#: Longest period that is sampled [mesh periods].
LONGEST_PERIOD = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Excitation:
    """Displacement excitation of a mesh.

    Parameters
    ----------
    stiffness : MeshStiffness
        Shares the errors among the pairs in contact.
    errors : tuple of TurningError or FlankError
    warnings : tuple of str
    """

    stiffness: MeshStiffness
    errors: tuple[TurningError | FlankError, ...]
    warnings: tuple[str, ...] = ()

    @cached_property
    def parts(self) -> tuple[TurningError | FlankExcitation, ...]:
        """What adds up to e, each with a period of its own."""
        return tuple(
            FlankExcitation(stiffness=self.stiffness.unmodulated, error=error)
            if isinstance(error, FlankError)
            else error
            for error in self.errors
        )

    @property
    def period_mesh(self) -> int:
        """True period [mesh periods], of errors and stiffness together."""
        return math.lcm(self.stiffness.period_mesh, *(error.period_mesh for error in self.errors))

    def of(self, gears: Sequence[str]) -> Excitation:
        """Return the excitation by the errors of these gears only."""
        return replace(self, errors=tuple(error for error in self.errors if error.gear in gears))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return e [m] at mesh phases, any shape; positive where material is missing."""
        x = np.asarray(phase, dtype=np.float64)
        return np.asarray(sum((part.at(x) for part in self.parts), np.zeros(x.shape)))

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

    def harmonics(self, count: int, period_mesh: int | None = None) -> ComplexArray:
        """Return e_0 ... e_count [m] of ``e = e_0 + sum_r (e_r exp(2 pi i r phase/P) + conj)``.

        Parameters
        ----------
        count : int, >= 0
        period_mesh : int, optional
            P, a multiple of the true period [mesh periods]; by default that.

        Returns
        -------
        ndarray of complex, shape (count + 1,)
            Exact, none aliased.
        """
        check_range("count", count, 0, 10_000_000)
        period = self.period_mesh if period_mesh is None else period_mesh
        total = np.zeros(count + 1, dtype=np.complex128)
        for part in self.parts:
            if period % part.period_mesh:
                raise ArgumentError(
                    f"period_mesh={period} must be a multiple of {part.period_mesh}, after which "
                    f"the errors of the {part.gear} repeat"
                )
            step = period // part.period_mesh
            total[::step] += part.lines(count // step)
        return total


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
        Of this mesh, with its faults; under a known force misaligned faces close their gaps.
    errors : iterable of GearError
        Of this stage; those of gears of other meshes are left aside. An error of 0 moves nothing.
    faults : iterable of Fault
        Wear, missing teeth and spalls across the whole face move the flanks too.

    Raises
    ------
    ArgumentError
        If a gear has no such tooth.
    """
    names = [member.name for member in pair.members]
    found: list[TurningError | FlankError] = []
    notes: list[str] = []
    for error in errors:
        if error.gear not in names:
            notes.append(f"error {error} does not act in the {pair.name} mesh")
            continue
        moved = error_of(error, pair, names.index(error.gear), stiffness.free_gap_m)
        if error.size_m:
            found.append(moved)
    for fault in faults:
        if fault.gear in names and not fault.is_loss:
            found += profile_lost_by(fault, pair, names.index(fault.gear))
    return Excitation(stiffness=stiffness, errors=tuple(found), warnings=tuple(notes))


def parse_fault_or_error(text: str) -> Fault | GearError:
    """Read a fault or an error of a gear; the kind decides.

    Parameters
    ----------
    text : str
        See `faults.parse_fault` and `parse_error`.

    Raises
    ------
    ArgumentError
        If the text is neither.

    Examples
    --------
    >>> parse_fault_or_error("pitch:1:gear:7:8um").kind
    'pitch'
    """
    kind = text.split(":")[0].strip()
    if kind in ERROR_KINDS:
        return parse_error(text)
    if kind not in KINDS:
        near = nearest_name(kind, (*KINDS, *ERROR_KINDS))
        hint = f"; did you mean {near}?" if near else ""
        raise ArgumentError(
            f"fault kind {kind!r} is not one of {', '.join((*KINDS, *ERROR_KINDS))}{hint}"
        )
    return parse_fault(text)


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
