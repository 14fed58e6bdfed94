"""Harvesting: where to put a vibration energy harvester, how to tune it, what it will power.

Everything rests on one number a frequency: the mean square of the acceleration there [m2/s4], from
lines that are expected or measured. A harvester is linear, so its mean power is the sum over
frequencies of that number times a gain.
"""
