"""Mesh stiffness modulated by the turn of its gears: sidebands of eccentricity and their kin.

Eccentricity, slow cumulative pitch error and misalignment change the contact of all teeth of a gear
once per turn. The mesh stiffness is that of the contact as it is at each instant, K(phase; theta):
quasi-static, exact for the teeth in that contact. Its coefficients at mesh order m and gear order s
are those of a Fourier series in theta,

    c_{m,s} = <exp(-2 pi i m b(theta)) P_m(l(theta)) f(theta) exp(-i s theta)>

with P_m the transform of the pulse of one pair whose contact ratio is l smaller, b its delay and f
the part of the face that carries. With l = 0 and f = 1 that is ``P_m i^s J_s(2 pi m |b|)`` up to
the phase: the phase modulation of McFadden, whose index grows with the mesh harmonic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.gears.contact_family import ContactFamily
from gearmon.gears.contact_offset import (
    ContactOffset,
    OffsetState,
    contact_offsets,
    state_of,
)
from gearmon.gears.missing_material import GearError
from gearmon.gears.pairs import MeshPair
from gearmon.gears.panels import ComplexArray, FloatArray
from gearmon.gears.pulses import Pulse

#: Angles of a gear at which the carrying part of a misaligned face is taken; it has corners.
SHARE_ANGLES, JOINT_SHARE_ANGLES = 4096, 64
#: Gear orders beyond the index of modulation at which its lines are below rounding error.
SPARE_ORDERS = 14
#: Mesh orders computed together; bounds the memory.
ORDERS_PER_BLOCK, JOINT_ORDERS_PER_BLOCK = 1024, 128

IntArray = NDArray[np.integer]


@dataclass(frozen=True, kw_only=True, eq=False)
class ModulationTrain:
    """What turning gears change of the mesh stiffness: a part with a period of its own.

    Parameters
    ----------
    gear : str
        The gear, or both ("pinion and gear") for what their errors together change beyond the sum.
    family : ContactFamily
    offsets : tuple of ContactOffset
        One, or two for both gears.
    free_gap_m : float
        Lead deviation that the load just closes.
    """

    gear: str
    family: ContactFamily
    offsets: tuple[ContactOffset, ...]
    free_gap_m: float

    @property
    def period_mesh(self) -> int:
        """Period [mesh periods]: the teeth of the gear, or the hunting period."""
        return math.lcm(*(offset.teeth for offset in self.offsets))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return this part of the stiffness [N/m] at `phase` [mesh periods], any shape."""
        x = np.asarray(phase, dtype=np.float64)
        flat = x.ravel()
        total = np.zeros(len(flat))
        for sign, chosen in self._signed:
            state = self._state(chosen, [2 * np.pi * flat / o.teeth for o in chosen], len(flat))
            total += sign * state.share * self.family.at(flat, state.leaving, state.entering)
        return total.reshape(x.shape)

    def coefficients(self, orders: ArrayLike) -> ComplexArray:
        """Return the Fourier coefficients [N/m] at whole orders of its period.

        Parameters
        ----------
        orders : array_like of int, shape (n,)
            r: order r/period_mesh of the mesh frequency; 0 gives the mean.
        """
        r = np.atleast_1d(np.asarray(orders, dtype=np.int64))
        wanted = np.zeros(int(np.abs(r).max(initial=0)) + 1, dtype=np.complex128)
        period = self.period_mesh
        most = len(wanted) // period + 1
        reach = max(self._sidebands(most, len(self.offsets)) // o.teeth for o in self.offsets)
        below = len(self.offsets) * (reach + 1)
        block = ORDERS_PER_BLOCK if len(self.offsets) == 1 else JOINT_ORDERS_PER_BLOCK
        for low in range(0, most + below + 1, block):
            meshes = np.arange(low, min(low + block, most + below + 1))
            self._add(wanted, meshes)
        found = wanted[np.abs(r)]
        return np.asarray(np.where(r < 0, found.conj(), found))

    def windows(self, points_per_mesh: int) -> list[tuple[int, FloatArray]]:
        """Return first sample and samples [N/m] at the phases i/points_per_mesh of the period."""
        count = self.period_mesh * points_per_mesh
        return [(0, self.at(np.arange(count) / points_per_mesh))]

    @cached_property
    def _signed(self) -> list[tuple[int, tuple[ContactOffset, ...]]]:
        """Which gears move, and the sign with which that enters."""
        if len(self.offsets) == 1:
            return [(1, self.offsets), (-1, ())]
        one, two = self.offsets
        return [(1, self.offsets), (-1, (one,)), (-1, (two,)), (1, ())]

    def _state(
        self, chosen: tuple[ContactOffset, ...], angles: Iterable[FloatArray], count: int
    ) -> OffsetState:
        state = state_of(chosen, angles, self.free_gap_m)
        return OffsetState(
            leaving=np.broadcast_to(state.leaving, count),
            entering=np.broadcast_to(state.entering, count),
            share=np.broadcast_to(state.share, count),
        )

    def _sidebands(self, order: int, gears: int) -> int:
        """Return up to which gear order lines about a mesh order are to be had."""
        reach = self._shifted(order)
        if any(offset.lead_m for offset in self.offsets):
            reach = max(reach, (SHARE_ANGLES if gears == 1 else JOINT_SHARE_ANGLES) // 4)
        return reach

    def _shifted(self, order: int) -> int:
        """Return the same without misalignment, whose corners reach farther."""
        if not any(offset.leaving or offset.entering for offset in self.offsets):
            return 0
        index = max(
            2 * math.pi * order * max(abs(o.leaving), abs(o.entering)) for o in self.offsets
        )
        return math.ceil(index + 3 * math.cbrt(index)) + SPARE_ORDERS

    def _add(self, wanted: ComplexArray, meshes: IntArray) -> None:
        """Add the lines about some mesh orders to the half spectrum `wanted`."""
        reach = self._sidebands(int(meshes[-1]), len(self.offsets))
        lines = (
            self._joint(meshes, reach) if len(self.offsets) == 2 else self._single(meshes, reach)
        )
        period = self.period_mesh
        place = meshes * period
        for offset in self.offsets:
            steps = np.arange(-reach, reach + 1) * (period // offset.teeth)
            place = place[..., None] + steps
        values = np.moveaxis(lines, -1, 0)
        # mesh order 0 holds its own conjugates already; of the others those below 0 are mirrored
        mirrored = np.broadcast_to((meshes > 0).reshape(-1, *[1] * (place.ndim - 1)), place.shape)
        inside = (place >= 0) & (place < len(wanted))
        np.add.at(wanted, place[inside], values[inside])
        inside = mirrored & (place <= 0) & (place > -len(wanted))
        np.add.at(wanted, -place[inside], values[inside].conj())

    def _single(self, meshes: IntArray, reach: int) -> ComplexArray:
        """Return c_{m,s} less the even mesh, shape (2 reach + 1, mesh orders)."""
        (offset,) = self.offsets
        shifted = self._shifted(int(meshes[-1]))
        count = 2 * shifted + 2
        state = self._state(self.offsets, [2 * np.pi * np.arange(count) / count], count)
        moved = self.family.coefficients(meshes, state.leaving, state.entering)
        lines = _around(np.fft.fft(moved, axis=0, norm="forward"), shifted)
        if offset.lead_m:
            fine = 2 * np.pi * np.arange(SHARE_ANGLES) / SHARE_ANGLES
            share = state_of(self.offsets, [fine], self.free_gap_m).share
            factor = np.fft.fft(share, norm="forward")[np.arange(-reach, reach + 1)]
            lines = _convolved(lines, factor, reach)
        lines[reach] -= self.family.coefficients(meshes, np.zeros(1), np.zeros(1))[0]
        return lines

    def _joint(self, meshes: IntArray, reach: int) -> ComplexArray:
        """Return c_{m,s1,s2} less those of each gear, shape (s1, s2, mesh orders)."""
        count = 2 * reach + 2
        angle = 2 * np.pi * np.arange(count) / count
        angles = [np.repeat(angle, count), np.tile(angle, count)]
        total = np.zeros((count, count, len(meshes)), dtype=np.complex128)
        for sign, chosen in self._signed:
            own = [a for a, o in zip(angles, self.offsets, strict=True) if o in chosen]
            state = self._state(chosen, own, count * count)
            lines = self.family.coefficients(meshes, state.leaving, state.entering)
            total += sign * (state.share[:, None] * lines).reshape(total.shape)
        once = _around(np.fft.fft(total, axis=0, norm="forward"), reach)
        twice = _around(np.moveaxis(np.fft.fft(once, axis=1, norm="forward"), 1, 0), reach)
        return np.moveaxis(twice, 0, 1)


def modulation_trains(
    pair: MeshPair,
    errors: Iterable[GearError],
    member: Callable[[float], Pulse],
    free_gap_m: float,
) -> tuple[tuple[ModulationTrain, ...], list[str]]:
    """Return what errors of turning gears change of a mesh stiffness, and notes.

    Parameters
    ----------
    pair : MeshPair
    errors : iterable of GearError
    member : callable
        Gives the pulse [N/m] of a pair whose contact ratio is so much smaller.
    free_gap_m : float
        Lead deviation that the load just closes.

    Notes
    -----
    Where a zone of contact would vanish (the contact ratio swings across a whole number) only the
    delay of the contact is taken, at its usual length.
    """
    offsets = contact_offsets(pair, errors)
    if not offsets:
        return (), []
    largest = sum(abs(offset.leaving + offset.entering) for offset in offsets)
    family = ContactFamily.of(member, largest, pair.overlap_ratio)
    notes = []
    if family is None:
        notes.append(
            f"the errors of {' and '.join(o.gear for o in offsets)} change the contact ratio "
            f"{pair.contact_ratio:.4g} by up to {largest:.2g}, across a whole number: only the "
            f"delay of the contact modulates the stiffness, not its length"
        )
        family = ContactFamily.rigid(member(0.0), pair.overlap_ratio)
    moving = [(offset,) for offset in offsets] + ([offsets] if len(offsets) == 2 else [])
    trains = [
        ModulationTrain(
            gear=" and ".join(offset.gear for offset in own),
            family=family,
            offsets=own,
            free_gap_m=free_gap_m,
        )
        for own in moving
    ]
    return tuple(trains), notes


def _around(lines: ComplexArray, reach: int) -> ComplexArray:
    """Return the lines -reach ... reach of a discrete Fourier transform along its first axis."""
    return np.asarray(lines[np.arange(-reach, reach + 1)])


def _convolved(lines: ComplexArray, factor: ComplexArray, reach: int) -> ComplexArray:
    """Return the lines -reach ... reach of a product; both along the first axis."""
    half = len(lines) // 2
    size = len(lines) + len(factor)
    product = np.fft.fft(lines, size, axis=0) * np.fft.fft(factor, size)[:, None]
    return np.asarray(np.fft.ifft(product, axis=0)[half : half + 2 * reach + 1])
