"""Families of signatures: a machine healthy, and with every kind and size of fault of every gear.

The healthy mesh is solved once, and of every fault what it changes (see `baseline`). A fault of
tooth j gives the lines of tooth 1, turned by ``exp(-2 pi i r (j - 1)/z)`` at the harmonic r of the
gear's turn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, check_range, check_word
from gearmon.gears.faults import ERROR_KINDS, KINDS, WHOLE_KINDS, Fault, parse_fault_or_error
from gearmon.gears.kinematics import kinematics
from gearmon.gears.pulses import LEAST_OVERLAP
from gearmon.gears.tooth_pairs import POTENTIAL_ENERGY
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.result import Result
from gearmon.signatures.expected.baseline import faulty_lines, periodic_lines, refuse_no_lines
from gearmon.signatures.expected.mesh import MeshLines, MeshPlace, PosedStage, Wrong, joined, rms
from gearmon.signatures.signature import AMPLITUDES, Signature

#: What a family holds unless told otherwise. A crack in % is a uniform loss of stiffness.
FAMILY_KINDS: tuple[str, ...] = ("crack", "breakage", "pitting", "spall", "wear", "missing")
FAMILY_KINDS += ("pitch", "eccentricity", "misalignment")
LOSSES: tuple[str, ...] = ("2.5%", "5%", "10%", "20%", "40%")
ERROR_SIZES: tuple[str, ...] = ("5um", "10um", "20um", "40um")
GONE: tuple[str, ...] = ("1tooth",)
#: Kinds that take as a loss the same pulse, more or less of it; breakage does of spur teeth only.
EVEN_KINDS = ("breakage", "crack", "stiffness", "pitting", "spall")
#: Kinds that concern all teeth of a gear.
ALL_TEETH = ("wear", "profile", *WHOLE_KINDS)

Size = float | str
# Columns of the table beside those of the lines.
_TOLD = ("kind", "gear", "size", "loss", "operating")


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilyMember:
    """One kind and size of fault of one gear at one operating point.

    Parameters
    ----------
    kind, gear : str
    stage : int
    size : str
        As in ``KIND:STAGE:GEAR:TOOTH:SIZE``.
    operating : int
        Operating point, from 0.
    lines : MeshLines
        Of its mesh, with tooth 1 faulty.
    sound : MeshLines
        Of the same without the fault.
    """

    kind: str
    stage: int
    gear: str
    size: str
    operating: int
    lines: MeshLines
    sound: MeshLines

    @property
    def loss(self) -> float:
        """Share that the pair of a faulty tooth loses of its stiffness, over its contact.

        0 for errors that take no stiffness.
        """
        return self.lines.posed.loss(self.sound.posed)

    @property
    def teeth(self) -> int:
        """Teeth for which there are lines of their own; 1 where the whole gear is concerned."""
        return 1 if self.fault().tooth is None else self.lines.period

    def fault(self, tooth: int = 1) -> Wrong:
        """Return the fault of one tooth."""
        return parse_fault_or_error(_words(self.kind, self.stage, self.gear, self.size, tooth))


@dataclass(frozen=True, kw_only=True, eq=False)
class FaultFamily(Result):
    """A machine healthy and with every fault asked for.

    Parameters
    ----------
    machine : Machine
    members : tuple of FamilyMember
        One for each kind, size, gear and operating point; teeth follow by turning.
    healthy : mapping of (int, int, int) to MeshLines
        The healthy meshes by operating point, stage and mesh (1: planet and ring).
    max_hz : float or None
        As asked for.
    tolerance : float
    notes : tuple of str
        What was left out, and why.
    """

    picture = "expected_plots.family_figure"

    machine: Machine
    members: tuple[FamilyMember, ...]
    healthy: Mapping[tuple[int, int, int], MeshLines]
    max_hz: float | None
    tolerance: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.members)

    def __iter__(self) -> Iterator[FamilyMember]:
        return iter(self.members)

    def table(self, mesh_harmonics: int | None = None, sidebands: int | None = None) -> Signature:
        """Return all lines of the family as one table.

        Parameters
        ----------
        mesh_harmonics, sidebands : int, optional
            Most mesh harmonics, and most sidebands to each side of them; by default all.

        Returns
        -------
        Signature
            Origin "expected family". Beside its columns: `kind`, `gear`, `size`, `loss`,
            `operating` (from 0); of each member the lines of its own stage with tooth 1 faulty, and
            those of the healthy stages (kind "healthy").
        """
        parts = [
            (lines, ("healthy", "ring" if mesh else "", "", 0.0, float(operating)))
            for (operating, _, mesh), lines in self.healthy.items()
        ]
        parts += [
            (m.lines, (m.kind, m.gear, m.size, m.loss, float(m.operating))) for m in self.members
        ]
        # lines below the first mesh harmonic are multiples of the turn, not its sidebands
        lowest, highest = (0, np.inf) if mesh_harmonics is None else (1, mesh_harmonics)
        tables = []
        for lines, told in parts:
            columns = lines.columns()
            harmonic, aside = columns["mesh_harmonic"], np.abs(columns["sideband"])
            kept = (harmonic >= lowest) & (harmonic <= highest)
            kept &= aside <= (np.inf if sidebands is None else sidebands)
            named = zip(_TOLD, told, strict=True)
            columns = {name: np.full(len(kept), own) for name, own in named} | columns
            tables.append({name: column[kept] for name, column in columns.items()})
        header = {
            "operating_points": [
                {"speed_rpm": point.speed_rpm, "torque_nm": point.torque_nm, "name": point.name}
                for point in self.machine.operating
            ],
            "max_hz": self.max_hz,
            "tolerance": self.tolerance,
            "amplitudes": AMPLITUDES + "; tooth 1 is faulty",
            "largest_error": max((m.lines.error for m in self.members), default=0.0),
            "notes": list(self.notes),
        }
        about = {"machine": self.machine.name, "origin": "expected family"}
        return Signature(**about, header=header, columns=joined(tables))

    def rows(self) -> list[dict[str, Any]]:
        """Return one row for each member: what it is, and how strong its lines are.

        `sidebands_ms2` is the rms acceleration of all lines that are no mesh harmonics,
        `mesh_change_ms2` that of the change of the mesh harmonics, `healthy_ms2` that of the
        healthy mesh, all up to the highest frequency asked for.
        """
        names = ("kind", "stage", "gear", "size", "loss", "operating", "teeth")
        rows = []
        for member in self.members:
            lines, even = member.lines.of_tooth(), member.sound
            mine, is_mesh = lines.acceleration, lines.number % lines.period == 0
            # a mesh line that the healthy set has not is new
            known = zip(even.number, even.carrier, strict=True)
            sound = dict(zip(known, even.acceleration, strict=True))
            places = zip(lines.number[is_mesh] // lines.period, lines.carrier[is_mesh], strict=True)
            meshes = mine[is_mesh] - np.array([sound.get(place, 0.0) for place in places])
            sizes = {
                "lines": len(mine),
                "healthy_ms2": rms(even.acceleration),
                "sidebands_ms2": rms(mine[~is_mesh]),
                "mesh_change_ms2": rms(meshes),
            }
            solved = {name: getattr(lines, name) for name in ("contact_lost", "method", "error")}
            rows.append({name: getattr(member, name) for name in names} | sizes | solved)
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return machine, rows and notes as built-in types that JSON can hold."""
        return {"machine": self.machine.name, "rows": self.rows(), "notes": list(self.notes)}


def fault_family(
    machine: MachineLike,
    kinds: Iterable[str] | None = None,
    sizes: Iterable[Size] | str | None = None,
    gears: Iterable[tuple[int, str] | str] | None = None,
    operating: Iterable[int] | int | None = None,
    max_hz: float | None = None,
    tolerance: float = 1e-6,
    *,
    form: str = "parabolic",
) -> FaultFamily:
    """Solve a machine healthy and with every kind and size of fault of every gear.

    Parameters
    ----------
    machine : Machine, path or dict
        With the data that a baseline needs.
    kinds : iterable of str, optional
        Kinds of `gears.faults.KINDS` and `gears.faults.ERROR_KINDS`; by default
        `FAMILY_KINDS`, of which those that the machine file has too little data for are left out
        and named in `FaultFamily.notes`.
    sizes : iterable of str or float, optional
        As in ``KIND:STAGE:GEAR:TOOTH:SIZE``, or numbers: the share of pair stiffness lost. Each
        is taken for all kinds that understand it (um are errors, mm damage). By default 2.5, 5,
        10, 20 and 40 % and 5, 10, 20 and 40 um.
    gears : iterable of (int, str) or str, optional
        Stages and gears, such as (1, "pinion"), "1:pinion" or "pinion"; by default all.
    operating : iterable of int, or int, optional
        Operating points, from 0; by default all.
    max_hz : float, optional
        Highest frequency [Hz], > 0; by default as in `expected_signature`.
    tolerance : float, in [1e-10, 1]
        Relative error of what a fault adds (an estimate), and of the acceleration of turns that
        are solved as a whole.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.

    Returns
    -------
    FaultFamily

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the machine lacks data.

    Notes
    -----
    One fault at a time, in one mesh of its stage: a planet meets the sun, unless the fault is of
    the ring. The motion is that of `expected_signature`: linear, along the line of action, before
    any path to a sensor.

    Examples
    --------
    >>> family = gearmon.fault_family(machine, kinds=["crack"], sizes=["20%"], max_hz=2000.0)
    >>> sorted({row["gear"] for row in family.rows()})
    ['gear', 'pinion']
    """
    machine = load_machine(machine)
    check_range("tolerance", tolerance, 1e-10, 1.0)
    texts = _sizes(kinds, sizes)
    every = range(len(machine.operating)) if operating is None else operating
    points = (every,) if isinstance(every, int) else tuple(dict.fromkeys(every))
    places = _places(machine, gears)
    for name, part in (("kinds", texts), ("gears", places), ("operating", points)):
        if not part:
            raise ArgumentError(f"{name}: none given, at least one is needed")
    meshes = {(number, 0) for number in range(1, len(machine.stages) + 1)}
    meshes |= {(stage, mesh) for (stage, _), mesh in places.items()}
    healthy: dict[tuple[int, int, int], MeshLines] = {}
    for number, (stage, mesh) in product(points, sorted(meshes)):
        even = MeshPlace(machine, stage, number, form, mesh).posed()
        # a set that is taken as a whole has all of its gears in one
        key = number, stage, mesh if even.train is None else 0
        if key not in healthy:
            healthy[key] = periodic_lines(even, even.limit_hz(max_hz), tolerance)
    if not any(len(lines.displacement) for lines in healthy.values()):
        refuse_no_lines((own.mechanics.mesh_frequency_hz for own in healthy.values()), max_hz)
    members: list[FamilyMember] = []
    notes: dict[str, None] = {}
    for number, ((stage, gear), mesh) in product(points, places.items()):
        place = MeshPlace(machine, stage, number, form, mesh)
        sound = healthy.get((number, stage, mesh)) or healthy[number, stage, 0]
        is_helical = sound.mechanics.stiffness.overlap_ratio >= LEAST_OVERLAP
        posed: dict[tuple[str, str], PosedStage] = {}
        for kind, sized in texts.items():
            try:
                posed |= dict(_posed(place, gear, kind, sized, is_helical))
            except ArgumentError as error:
                if kinds is not None:
                    raise
                notes[f"{kind} of the {gear} of stage {stage} left out: {error}"] = None
        members += _members(place, gear, posed, sound, max_hz, tolerance)
    return FaultFamily(
        machine=machine,
        members=tuple(members),
        healthy=healthy,
        max_hz=max_hz,
        tolerance=tolerance,
        notes=tuple(notes),
    )


def _posed(
    place: MeshPlace, gear: str, kind: str, sizes: Mapping[str, Wrong], is_helical: bool
) -> Iterator[tuple[tuple[str, str], PosedStage]]:
    """Pose all sizes of a kind; losses that take the same pulse, more or less, by a half."""
    alike = kind in EVEN_KINDS[is_helical:] and place.form != POTENTIAL_ENERGY
    half: PosedStage | None = None
    for size, wrong in sizes.items():
        own = replace(wrong, stage=place.stage, gear=gear)
        if alike and isinstance(own, Fault) and own.is_loss and own.loss:
            half = half or place.posed([replace(own, size=0.5, unit="")])
            yield (kind, size), half.scaled(2 * own.loss)
        else:
            yield (kind, size), place.posed([own])


def _members(
    place: MeshPlace,
    gear: str,
    posed: Mapping[tuple[str, str], PosedStage],
    healthy: MeshLines,
    max_hz: float | None,
    tolerance: float,
) -> Iterator[FamilyMember]:
    """Solve what is wrong with a gear, by kind and size."""
    limit_hz = healthy.posed.limit_hz(max_hz)
    found: dict[tuple[str, str], tuple[MeshLines, MeshLines]] = {}
    for alone in (False, True):
        own = {key: one for key, one in posed.items() if (one.train is None) == alone}
        sound = healthy
        # what a set cannot be solved with is taken by itself
        if own and (healthy.posed.train is None) != alone:
            sound = periodic_lines(place.alone(), limit_hz, tolerance)
        solved = faulty_lines(sound.posed, list(own.values()), limit_hz, tolerance)
        found |= {key: (lines, sound) for key, lines in zip(own, solved, strict=True)}
    where: dict[str, Any] = {"stage": place.stage, "gear": gear, "operating": place.operating}
    for kind, size in posed:
        lines, sound = found[kind, size]
        yield FamilyMember(**where, kind=kind, size=size, lines=lines, sound=sound)


def _words(kind: str, stage: int, gear: str, size: str, tooth: int = 1) -> str:
    """Return ``KIND:STAGE:GEAR:TOOTH:SIZE``, with TOOTH ``all`` where the kind asks for it."""
    place = "all" if kind in ALL_TEETH else str(tooth)
    return f"{kind}:{stage}:{gear}:{place}:{size}"


def _sizes(
    kinds: Iterable[str] | None, sizes: Iterable[Size] | str | None
) -> dict[str, dict[str, Wrong]]:
    """Return the sizes of each kind, as they are written and what they mean."""
    kinds = [kinds] if isinstance(kinds, str) else kinds
    chosen = FAMILY_KINDS if kinds is None else tuple(dict.fromkeys(kinds))
    for kind in chosen:
        check_word("kind ", kind, (*KINDS, *ERROR_KINDS))
    usual = {kind: ERROR_SIZES if kind in ERROR_KINDS else LOSSES for kind in chosen}
    usual["missing"] = GONE
    given = [sizes] if isinstance(sizes, str) else sizes or ()
    texts = [s.strip() if isinstance(s, str) else f"{100 * float(s):.12g}%" for s in given]
    found: dict[str, dict[str, Wrong]] = {kind: {} for kind in chosen}
    for kind, own in found.items():
        for text in usual[kind] if sizes is None or kind == "missing" else texts:
            # in a list for all kinds mm are depths of damage: an error of millimetres is none
            if kind not in ERROR_KINDS or text.endswith("um"):
                with suppress(ArgumentError):
                    own[text] = parse_fault_or_error(_words(kind, 1, "pinion", text))
    for text in texts:
        if not any(text in own for own in found.values()):
            raise ArgumentError(
                f"size {text!r} fits none of the kinds {', '.join(chosen)}: losses are written 0.2 "
                f"or 20%, damage 1.5mm or 12%flank, errors 20um"
            )
    for kind, own in found.items():
        if not own and kinds is not None:
            raise ArgumentError(f"no size fits kind {kind!r}; its default is {usual[kind]}")
    return {kind: own for kind, own in found.items() if own}


def _places(
    machine: Machine, gears: Iterable[tuple[int, str] | str] | None
) -> dict[tuple[int, str], int]:
    """Return stages and gears as asked for, and in which mesh each is taken."""
    wheels = [(mesh.stage, own.gear) for mesh in kinematics(machine).meshes for own in mesh.wheels]
    names = {f"{stage}:{gear}": (stage, gear) for stage, gear in wheels}
    chosen: dict[tuple[int, str], int] = {}
    for item in names if gears is None else gears:
        text = item.strip() if isinstance(item, str) else f"{item[0]}:{item[1]}"
        own = [place for name, place in names.items() if text in (name, place[1])]
        if not own:
            check_word("gear ", text, names)
        # with the sun, but for the ring
        chosen |= {place: int(place[1] == "ring") for place in own}
    return chosen
