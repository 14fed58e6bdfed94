"""Missing material of single flanks as the mesh feels it: window by window, with exact lines.

A pair that lacks material gives way to its neighbours: the mesh sees ``sum_i k_i e_i / sum_i k_i``.
Numerator and denominator are sums of pulses, so within each mesh period the quotient is smooth
between known corners, and its Fourier integrals are exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.curve_pulses import LARGEST_TURN, CurvePulse, product, subdivided
from gearmon.gears.missing_material import FlankError
from gearmon.gears.panels import ComplexArray, FloatArray
from gearmon.gears.pulse_trains import PulseTerm, PulseTrain
from gearmon.gears.pulses import Pulse
from gearmon.gears.stiffness import MeshStiffness

#: Most contacts of faulty teeth, each computed by itself, in a true period.
MOST_CONTACTS = 5_000

Windows = dict[tuple[tuple[int, int, int], ...], list[int]]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankExcitation:
    """Displacement excitation by one `FlankError`.

    Parameters
    ----------
    stiffness : MeshStiffness
    error : FlankError
    """

    stiffness: MeshStiffness
    error: FlankError

    @property
    def gear(self) -> str:
        """Gear of the error."""
        return self.error.gear

    @cached_property
    def period_mesh(self) -> int:
        """True period [mesh periods], with that of the stiffness that shares the load."""
        return math.lcm(self.stiffness.period_mesh, self.error.period_mesh)

    def at(self, phase: FloatArray) -> FloatArray:
        """Return e [m] at mesh phases."""
        stiffness = self.stiffness.at(phase)
        # without any load nothing is transmitted either
        return np.asarray(self.force.at(phase) / np.where(stiffness > 0, stiffness, 1.0))

    def lines(self, count: int) -> ComplexArray:
        """Return the Fourier coefficients 0 ... count [m] over `period_mesh`; none aliased."""
        v = np.arange(count + 1) / self.period_mesh
        total = np.zeros(count + 1, dtype=np.complex128)
        for windows in self._windows.values():
            pulse = self._quotient(windows[0])
            places = [np.exp(-2j * np.pi * v * n) for n in windows]
            total += pulse.transform(v) * np.sum(places, axis=0)
        return total / self.period_mesh

    @cached_property
    def force(self) -> PulseTrain:
        """sum_i k_i e_i [N], the force that would close all gaps."""
        pulses: dict[int, Pulse] = {}

        def with_gap(term: PulseTerm, entry: int) -> PulseTerm:
            if id(term.pulse) not in pulses:
                curve, corners = self.error.curve, self.error.corners
                pulses[id(term.pulse)] = product(term.pulse, curve, corners)
            return PulseTerm(
                pulse=pulses[id(term.pulse)],
                weight=term.weight,
                offset=float(entry),
                face_start=term.face_start,
                face_end=term.face_end,
            )

        terms = [with_gap(term, entry) for entry in self._entries for term in self._terms_of(entry)]
        return PulseTrain(
            gear=self.gear,
            period_mesh=self.period_mesh,
            overlap_ratio=self.stiffness.overlap_ratio,
            terms=tuple(terms),
        )

    @property
    def _entries(self) -> range:
        error = self.error
        found = range((error.tooth or 1) - 1, self.period_mesh, error.period_mesh)
        if len(found) > MOST_CONTACTS:
            raise ArgumentError(
                f"the errors repeat after {self.period_mesh} mesh periods only, in which their "
                f"flanks meet {len(found)} times, more than {MOST_CONTACTS}; ask for errors and "
                f"faults of one gear at a time"
            )
        return found

    def _terms_of(self, entry: int) -> Iterable[PulseTerm]:
        """Give what makes up the stiffness of the pair that enters at `entry`."""
        yield from self.stiffness.healthy.terms
        for train in self.stiffness.pulses:
            for term in train.terms:
                # a term without pieces takes nothing
                if (entry - round(term.offset)) % train.period_mesh == 0 and len(term.pulse.starts):
                    yield term

    @cached_property
    def _windows(self) -> Windows:
        """Mesh periods in which the error acts, grouped by what acts in them."""
        reach = math.ceil(self.stiffness.total_contact_ratio + 1e-9)
        active = {
            (entry + n) % self.period_mesh: n for entry in self._entries for n in range(reach)
        }
        if self.error.period_mesh < reach:
            active = dict.fromkeys(range(self.period_mesh), 0)
        grouped: Windows = {}
        for window, since in sorted(active.items()):
            key = [(-1, 0, since)]
            for t, train in enumerate(self.stiffness.pulses):
                for i, term in enumerate(train.terms):
                    ago = (window - round(term.offset)) % train.period_mesh
                    if ago < reach:
                        key.append((t, i, ago))
            grouped.setdefault(tuple(key), []).append(window)
        return grouped

    def _quotient(self, window: int) -> CurvePulse:
        """Return e within one mesh period, as a pulse that begins at phase 0."""
        return CurvePulse.of(self._edges, lambda phase: self.at(window + phase))

    @cached_property
    def _edges(self) -> FloatArray:
        """Corners of everything, folded into one mesh period."""
        trains = (self.force, self.stiffness.healthy, *self.stiffness.pulses)
        found: list[NDArray[np.float64]] = [np.array([0.0, 1.0])]
        fastest = 0.0
        for train in trains:
            for term in train.terms:
                pulse = term.pulse
                limits = term.offset + np.concatenate([pulse.starts, pulse.ends])
                found += [
                    limits + f * train.overlap_ratio for f in (term.face_start, term.face_end)
                ]
                fastest = max(fastest, float(np.abs(pulse.rates).max(initial=0.0)))
        return subdivided(
            _folded(np.concatenate(found)), LARGEST_TURN / fastest if fastest else 0.5
        )


def _folded(limits: ArrayLike) -> FloatArray:
    edges = np.unique(np.concatenate([np.mod(limits, 1.0), [0.0, 1.0]]))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-11])]
    edges[-1] = 1.0
    return np.asarray(edges)
