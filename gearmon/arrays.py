"""Arrays by what they hold, as type hints name them; stretches of what holds along one."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def runs_where(held: BoolArray) -> IntArray:
    """Return first place and end of each stretch in which something holds.

    Parameters
    ----------
    held : ndarray of bool, shape (n,)

    Returns
    -------
    ndarray of int, shape (stretches, 2)
        In order; the end is the place behind the last one.

    Examples
    --------
    >>> runs_where(np.array([True, True, False, True])).tolist()
    [[0, 2], [3, 4]]
    """
    return np.flatnonzero(np.diff(held, prepend=False, append=False)).reshape(-1, 2)
