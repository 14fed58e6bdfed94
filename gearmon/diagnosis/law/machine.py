"""The law of a whole machine: all gears and levels of a reference, ready to be held against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.law.gear_lines import GearDeviation, GearLaw, turned_alike
from gearmon.diagnosis.law.levels import LevelDeviation, level_deviation
from gearmon.diagnosis.law.state import operating_states
from gearmon.errors import ArgumentError
from gearmon.signatures.measured.reference import Profile, Reference, WheelPattern

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MachineDeviation:
    """How a recording departs from the law of its machine.

    Parameters
    ----------
    state : ndarray of float, shape (2,)
        Operating state of the recording: load [Np] and speed beside the first reference.
    gap : float
        Distance to the nearest reference's state.
    light : float
        By how much its load is lighter than that of every reference [Np]; 0 if it is not.
    length : float, in (0, 1]
        Its length over that of the shortest reference, at most 1.
    gears : tuple of GearDeviation
        One for each gear that recording and reference resolve.
    family_names : tuple of str
        Families of lines that were compared.
    levels : LevelDeviation
        Of those families.
    broadband : LevelDeviation or None
        Of the broadband spectrum; None if the reference is of an older format.
    """

    state: FloatArray
    gap: float
    light: float
    length: float
    gears: tuple[GearDeviation, ...]
    family_names: tuple[str, ...]
    levels: LevelDeviation
    broadband: LevelDeviation | None


@dataclass(frozen=True, kw_only=True, eq=False)
class HealthyMachine:
    """The law of one machine and some of its channels.

    Parameters
    ----------
    profiles : tuple of Profile
        The healthy recordings.
    rows : tuple of int
        Channels of theirs that are used.
    family_names : tuple of str
        Families of lines that all of them have.
    states : ndarray of float, shape (references, 2)
        Their operating states.
    gears : dict
        (stage, gear) to its law and whether the angle zero is that of a tachometer.
    """

    profiles: tuple[Profile, ...]
    rows: tuple[int, ...]
    family_names: tuple[str, ...]
    states: FloatArray
    gears: dict[tuple[int, str], tuple[GearLaw, bool]]

    @classmethod
    def of(cls, reference: Reference, rows: Sequence[int]) -> HealthyMachine:
        """Build the law from a reference."""
        profiles, every = reference.profiles, [rows] * len(reference.profiles)
        states = operating_states(profiles, profiles[0], every, rows)
        gears: dict[tuple[int, str], tuple[GearLaw, bool]] = {}
        for wheel in profiles[0].wheels:
            same = [found for p in profiles if (found := same_gear(wheel, p)) is not None]
            if len(same) < len(profiles) or not all(len(one.number) for one in same):
                continue
            # the tachometer's zero is that of shaft 1: other shafts stand anywhere when it comes
            indexed = all(p.tacho for p in profiles) and abs(wheel.order - 1.0) < 1e-12
            patterns = turned_alike(same, every, same_zero=indexed)
            law = GearLaw(wheel=wheel, patterns=patterns, states=states)
            gears[wheel.stage, wheel.gear] = law, indexed
        return cls(
            profiles=profiles,
            rows=tuple(rows),
            family_names=tuple(reference.family_names),
            states=states,
            gears=gears,
        )

    def indexed(self, own: Profile, stage: int, gear: str) -> bool:
        """Whether recording and references count the turns of a gear from the same pulse."""
        return own.tacho and self.gears[stage, gear][1]

    def deviation(
        self, own: Profile, rows: Sequence[int], left_out: Sequence[str] = ()
    ) -> MachineDeviation:
        """Hold a recording against the law.

        Parameters
        ----------
        own : Profile
            The recording.
        rows : sequence of int
            Its channels, those of the law.
        left_out : sequence of str
            Families of lines not to compare.

        Raises
        ------
        ArgumentError
            If no family of lines is left.
        """
        state = operating_states([own], self.profiles[0], [rows], self.rows)[0]
        gears = []
        for wheel in own.wheels:
            law, _ = self.gears.get((wheel.stage, wheel.gear), (None, False))
            if law is None or law.wheel.teeth != wheel.teeth:
                continue
            zero = self.indexed(own, wheel.stage, wheel.gear)
            found = law.deviation(wheel, rows, state, same_zero=zero)
            if found is not None:
                gears.append(found)
        names = [n for n in own.family_names if n in self.family_names and n not in left_out]
        if not names:
            raise ArgumentError(
                f"{own.origin}: shares no family of lines with the reference: sampling rate or "
                "length differ too much"
            )
        return MachineDeviation(
            state=state,
            gap=float(np.min(np.linalg.norm(self.states - state, axis=1))),
            light=float(max(0.0, self.states[:, 0].min() - state[0])),
            length=min(1.0, own.duration_s / min(p.duration_s for p in self.profiles)),
            gears=tuple(gears),
            family_names=tuple(names),
            levels=self._levels(own, rows, names, state),
            broadband=self._broadband(own, rows, state),
        )

    def _levels(
        self, own: Profile, rows: Sequence[int], names: Sequence[str], state: FloatArray
    ) -> LevelDeviation:
        def taken(profile: Profile, values: NDArray[Any], channels: Sequence[int]) -> NDArray[Any]:
            columns = [profile.family_names.index(name) for name in names]
            return values[np.ix_(list(channels), columns)]

        return level_deviation(
            taken(own, own.level_db, rows),
            taken(own, own.scatter_db, rows),
            np.array([taken(p, p.level_db, self.rows) for p in self.profiles]),
            np.array([taken(p, p.scatter_db, self.rows) for p in self.profiles]),
            self.states,
            state,
            told=taken(own, own.heard, rows),
        )

    def _broadband(
        self, own: Profile, rows: Sequence[int], state: FloatArray
    ) -> LevelDeviation | None:
        known = [p.band_db[list(self.rows)] for p in self.profiles]
        new = own.band_db[list(rows)]
        if not new.shape[1] or any(one.shape != new.shape for one in known):
            return None
        healthy = np.array(known)
        return level_deviation(
            new,
            np.zeros_like(new),
            healthy,
            np.zeros_like(healthy),
            self.states,
            state,
            broadband=True,
        )


def same_gear(wheel: WheelPattern, profile: Profile) -> WheelPattern | None:
    """Return the pattern of the same gear in another recording, or None."""
    key = wheel.stage, wheel.gear, wheel.teeth
    return next((w for w in profile.wheels if (w.stage, w.gear, w.teeth) == key), None)
