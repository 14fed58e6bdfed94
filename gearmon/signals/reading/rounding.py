"""Decimal to binary: the double nearest to m * 10**p, for whole arrays at once.

Every value equals what Python's ``float`` makes of the same digits. Three ways, cheapest first:

1. m <= 2**53 and abs(p) <= 22: m and the power are doubles without error, so one multiplication or
   division, correctly rounded by IEEE 754, is the answer.
2. m < 10**19: the upper 64 bits of 5**p, times m, give a 128-bit product that is too small by less
   than one unit of its upper half. Unless the bits below the rounding position are all ones, that
   decides the rounding; if they are, the next 64 bits of 5**p nearly always do.
3. What is left (exact halves, extreme exponents) goes through Python's own reading of numbers.

References
----------
D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51 (2021),
sections 5 and 6.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

Words = npt.NDArray[np.uint64]
Integers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

_LARGEST_EXACT = np.uint64(2**53)
_EXACT_POWERS = 10.0 ** np.arange(23)
_LOW_HALF = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)
_MANTISSA_BITS = np.uint64(52)
# Outside these powers of ten the result may be subnormal, zero or infinite.
_LOWEST_POWER, _HIGHEST_POWER = -300, 280


def decimal_to_double(mantissa: Words, power: Integers) -> Floats:
    """Return the doubles nearest to ``mantissa * 10**power``, ties to even.

    Parameters
    ----------
    mantissa : ndarray of uint64, shape (n,)
        Decimal digits read as a whole number, below 10**19.
    power : ndarray of int64, shape (n,)
        Power of ten.

    Returns
    -------
    ndarray of float64, shape (n,)

    Examples
    --------
    >>> decimal_to_double(np.array([125], np.uint64), np.array([-2]))
    array([1.25])
    """
    values = _by_exact_operands(mantissa, power)
    wide = np.flatnonzero((mantissa > _LARGEST_EXACT) | (np.abs(power) > 22))
    if wide.size:
        values[wide] = _by_long_product(mantissa[wide], power[wide])
    return values


def _by_exact_operands(mantissa: Words, power: Integers) -> Floats:
    values = mantissa.astype(np.float64)
    if power.size and int(power.max()) <= 0:  # the usual case: decimals, no exponents
        values /= _EXACT_POWERS.take(-power, mode="clip")
        return values
    scale = _EXACT_POWERS.take(np.abs(power), mode="clip")
    return np.where(power < 0, values / scale, values * scale)


def _by_long_product(mantissa: Words, power: Integers) -> Floats:
    within = np.clip(power, _LOWEST_POWER, _HIGHEST_POWER)
    shift = np.uint64(64) - _bit_length(mantissa)
    high, low = _scaled(mantissa << shift, within - _LOWEST_POWER)
    top = high >> np.uint64(63)
    # 54 bits: the mantissa of a double and the bit that rounds it
    rounded = high >> (top + np.uint64(9))
    half_way = (low <= 1) & ((rounded << (top + np.uint64(9))) == high)
    open_ended = _all_ones(high) & (low >= np.uint64(2**64 - 2))
    rounded = (rounded + (rounded & np.uint64(1))) >> np.uint64(1)
    exponent = ((217706 * within) >> 16) + 63 + top.astype(np.int64) - shift.astype(np.int64)
    values = _assemble(rounded, exponent)
    for index in np.flatnonzero(half_way | open_ended | (power != within) | (mantissa == 0)):
        values[index] = float(f"{mantissa[index]}e{power[index]}")
    return values


def _scaled(mantissa: Words, index: Integers) -> tuple[Words, Words]:
    """Return the upper 128 bits of the product with the power of five of that index."""
    upper, lower = _powers_of_five()
    high, low = _product(mantissa, upper.take(index))
    near = np.flatnonzero(_all_ones(high))
    if near.size:
        carried, _ = _product(mantissa[near], lower.take(index[near]))
        low[near] += carried
        high[near] += low[near] < carried
    return high, low


def _all_ones(high: Words) -> npt.NDArray[np.bool_]:
    # A carry into the bits that are kept is possible only from here.
    ones: npt.NDArray[np.bool_] = (high & np.uint64(0x1FF)) == 0x1FF
    return ones


def _assemble(mantissa: Words, exponent: Integers) -> Floats:
    # Adding lets a mantissa that was rounded up to 2**53 carry into the exponent.
    hidden_bit = np.uint64(1) << _MANTISSA_BITS
    biased = (exponent + 1023).astype(np.uint64) << _MANTISSA_BITS
    return (biased + (mantissa - hidden_bit)).view(np.float64)


def _bit_length(values: Words) -> Words:
    smeared = values.copy()
    for shift in (1, 2, 4, 8, 16, 32):
        smeared |= smeared >> np.uint64(shift)
    return np.bitwise_count(smeared).astype(np.uint64)


def _product(first: Words, second: Words) -> tuple[Words, Words]:
    """Return the upper and lower 64 bits of the products of two 64-bit words."""
    first_low, first_high = first & _LOW_HALF, first >> _HALF
    second_low, second_high = second & _LOW_HALF, second >> _HALF
    lowest = first_low * second_low
    cross, other = first_low * second_high, first_high * second_low
    middle = (lowest >> _HALF) + (cross & _LOW_HALF) + (other & _LOW_HALF)
    high = first_high * second_high + (cross >> _HALF) + (other >> _HALF) + (middle >> _HALF)
    return high, (middle << _HALF) | (lowest & _LOW_HALF)


@cache
def _powers_of_five() -> tuple[Words, Words]:
    """Return the upper 128 bits of 5**p, rounded down, for all powers, as two lists of words."""
    bits = [_leading_bits(p) for p in range(_LOWEST_POWER, _HIGHEST_POWER + 1)]
    upper = np.array([number >> 64 for number in bits], np.uint64)
    return upper, np.array([number & (2**64 - 1) for number in bits], np.uint64)


def _leading_bits(power: int) -> int:
    if power >= 0:
        five: int = 5**power
        return five << 128 >> five.bit_length()
    divisor: int = 5**-power
    return (1 << (divisor.bit_length() + 127)) // divisor
