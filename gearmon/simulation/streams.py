"""Random numbers by name: what is drawn for one purpose never depends on what others draw.

Every purpose (the pitch errors of one gear, the noise of one channel) has a generator of its own,
made from the seed and the name of the purpose. A machine with a fault, with more channels or with
another duration is then still the same machine.
"""

from __future__ import annotations

import zlib

import numpy as np

from gearmon.errors import ArgumentError


def stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the generator of one purpose.

    Parameters
    ----------
    seed : int, >= 0
    *purpose : str or int
        What the numbers are for, such as ``"pitch", 1, "pinion"``.

    Examples
    --------
    >>> one, two = stream(7, "noise", 1), stream(7, "noise", 1)
    >>> bool(one.random() == two.random())
    True
    """
    name = "/".join(str(part) for part in purpose).encode()
    return np.random.default_rng([seed, zlib.crc32(name)])


def check_seed(name: str, seed: int) -> int:
    """Return `seed` as an int.

    Raises
    ------
    ArgumentError
        If it is not a whole number from 0 on.
    """
    if isinstance(seed, bool) or seed != int(seed) or seed < 0:
        raise ArgumentError(f"{name}={seed} must be a whole number >= 0")
    return int(seed)
