"""What a loss of stiffness of one tooth adds to the lines of its mesh: templates for detection."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import parse_fault_or_error
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine
from gearmon.signatures.fault_family_members import ComplexArray, FloatArray, IntArray, fault_text
from gearmon.signatures.fault_family_mesh import (
    common_grid,
    default_limit_hz,
    first_order,
    mesh_with,
    operating_point,
    pair_loss,
    solved,
    turn_of,
)

#: Loss at which the answer per unit of loss is taken.
SMALL_LOSS = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class LossResponse:
    """What a loss of stiffness of one tooth adds to the lines of its mesh, per unit of loss.

    Parameters
    ----------
    stage : int
    gear : str
    kind : str
    teeth : int
        z of the gear.
    operating : int
    loss : float
        Loss at which it holds: the share that the pair of the tooth loses of its stiffness,
        integrated over its contact; 0 for the derivative at no loss.
    number : ndarray of int, shape (n,)
        r = 1..n: harmonics of the turn of the gear in its mesh; mesh harmonic h is r = h z.
    order, frequency_hz : ndarray, shape (n,)
        Frequency over that of shaft 1, and in Hz at the operating point.
    acceleration : complex ndarray, shape (n,)
        Change of acceleration over loss [m/s2], tooth 1; half of peak amplitudes. At `loss`, or at
        small losses, the lines are ``mesh_acceleration + loss * acceleration``.
    mesh_acceleration : complex ndarray, shape (n,)
        The healthy mesh [m/s2]; zero but at multiples of z.
    """

    stage: int
    gear: str
    kind: str
    teeth: int
    operating: int
    loss: float
    number: IntArray
    order: FloatArray
    frequency_hz: FloatArray
    acceleration: ComplexArray
    mesh_acceleration: ComplexArray

    def at_tooth(self, tooth: int | IntArray) -> ComplexArray:
        """Return `acceleration` for other teeth, shape (..., n) for teeth of shape (...)."""
        numbers = np.asarray(tooth)
        turns = np.multiply.outer(numbers - 1, self.number) % self.teeth
        return np.asarray(self.acceleration * np.exp(-2j * np.pi / self.teeth * turns))


def loss_response(
    machine: Machine,
    stage: int,
    gear: str,
    operating: int = 0,
    max_order: float | None = None,
    *,
    kind: str = "crack",
    loss: float = 0.0,
    form: str = "parabolic",
) -> LossResponse:
    """Return what a small loss of stiffness of one tooth adds to the lines of its mesh.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs.
    stage : int
        From 1.
    gear : str
        "pinion", "gear", "sun", "planet" or "ring".
    operating : int
        Operating point, from 0.
    max_order : float, optional
        Highest order of shaft 1; by default 10 mesh harmonics or 2 natural frequencies.
    kind : {"crack", "stiffness", "breakage", "pitting", "spall"}
        How the loss is spread along the contact of the tooth.
    loss : float, in [0, 1)
        0 for the derivative at no loss; else the whole change at this loss (the lost share of the
        stiffness of the pair where the fault acts), divided by `LossResponse.loss`.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.

    Returns
    -------
    LossResponse
        Costs one mesh period and the contact of one tooth.

    Raises
    ------
    ArgumentError
        If the machine lacks data, has no such gear, or nothing lies below `max_order`.

    Notes
    -----
    The derivative at no loss leaves out what is of second order: of the shipped machines it misses
    the sidebands by 1 to 3 % of them at a loss of 1 %, 20 to 30 % at 20 %. A corner that breaks off
    a helical tooth moves on along the face as it grows: its derivative holds for slivers only, so
    give a `loss` there.
    """
    if kind not in ("crack", "stiffness", "breakage", "pitting", "spall"):
        raise ArgumentError(
            f"kind={kind!r} must be one of: crack, stiffness, breakage, pitting, spall"
        )
    place = mesh_with(machine, stage, gear)
    point = operating_point(machine, operating)
    check_range("loss", loss, 0.0, 0.999)
    fault = parse_fault_or_error(fault_text(kind, stage, gear, repr(float(loss) or SMALL_LOSS)))
    healthy = turn_of(machine, stage, point, None, form, place)
    turn = turn_of(machine, stage, point, fault, form, place)
    mesh_order = kinematics(machine).mesh(stage).order
    highest_hz = default_limit_hz(healthy.mechanics)
    if max_order is not None:
        check_positive("max_order", max_order)
        highest_hz = max_order * point.shaft1_hz
    teeth = turn.period
    count = math.floor(highest_hz / healthy.mechanics.mesh_frequency_hz * teeth * (1 + 1e-12))
    if count < 1:
        raise ArgumentError(f"max_order={max_order} lies below the first line: nothing is left")
    even = healthy.even(common_grid([healthy, turn], highest_hz))
    lost = pair_loss(turn, healthy.mechanics)
    if loss:
        added = solved([turn], teeth, even).lines(count)[0] / lost
    else:
        added = first_order([turn], np.array([lost]), teeth, even).lines(count)[0]
    number = np.arange(1, count + 1)
    frequency = number * (healthy.mechanics.mesh_frequency_hz / teeth)
    to_acceleration = -((2 * math.pi * frequency) ** 2)
    mesh = np.zeros(count, dtype=np.complex128)
    mesh[teeth - 1 :: teeth] = even.lines(count // teeth)
    return LossResponse(
        stage=stage,
        gear=gear,
        kind=kind,
        teeth=teeth,
        operating=operating,
        loss=lost if loss else 0.0,
        number=number,
        order=np.asarray(number * (mesh_order / teeth), dtype=np.float64),
        frequency_hz=np.asarray(frequency, dtype=np.float64),
        acceleration=to_acceleration * added,
        mesh_acceleration=to_acceleration * mesh,
    )
