"""All orders at which the gears and shafts of a machine can show."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.kinematics import Kinematics

FloatArray = NDArray[np.float64]


def known_orders(train: Kinematics, top: float, width: float) -> FloatArray:
    """Orders at which the gears and shafts of a machine can show.

    Parameters
    ----------
    train : Kinematics
        The machine.
    top : float
        Highest order wanted.
    width : float
        Resolution: rotations less than six times this apart are followed for twelve harmonics
        only, for all of them would leave no place for anything else.

    Returns
    -------
    ndarray of float
        Ascending: multiples of all rotations; mesh harmonics with six sidebands of every rotation,
        and sums of two rotations up to the third; sums and differences of mesh harmonics.
    """
    turning = sorted(
        {shaft.order for shaft in train.shafts}
        | {wheel.relative_order for mesh in train.meshes for wheel in mesh.wheels}
        | {float(family.exact) for mesh in train.meshes for family in mesh.modulations}
    )
    turning = [order for order in turning if order > 0]
    orders = [
        rotation * np.arange(1, int(top / rotation) + 1 if rotation > 6 * width else 13)
        for rotation in turning
    ]
    about = np.array([0.0] + [r * one for one in turning for r in range(-6, 7) if r])
    beside = [
        a * one + b * other
        for one, other in combinations(turning, 2)
        for a, b in ((1, 1), (1, 2), (2, 1), (1, -1), (1, -2), (2, -1))
    ]
    about = np.concatenate([about, beside, -np.array(beside)])
    meshes = [mesh.order * np.arange(1, int(top / mesh.order) + 2) for mesh in train.meshes]
    orders += [(harmonics[:, None] + about).ravel() for harmonics in meshes]
    for one, other in combinations(meshes, 2):
        orders.append(np.abs(one[:, None] + other).ravel())
        orders.append(np.abs(one[:, None] - other).ravel())
    whole = np.concatenate(orders)
    return np.unique(np.round(whole[(whole > 0) & (whole <= top)], 9))


def distance_to(known: FloatArray, orders: FloatArray) -> FloatArray:
    """Distance of orders to the nearest of ascending known ones; infinite if there is none."""
    if len(known) == 0:
        return np.full(len(orders), np.inf)
    after = np.searchsorted(known, orders)
    above = np.abs(known[np.minimum(after, len(known) - 1)] - orders)
    below = np.abs(known[np.maximum(after - 1, 0)] - orders)
    return np.asarray(np.minimum(above, below), dtype=np.float64)
