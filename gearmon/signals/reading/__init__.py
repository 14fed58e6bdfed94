"""Recordings in files and in memory: the numbers in them, and what they mean.

`gearmon.read_recording` takes two steps, each of which ends in numbers or in one clear line:

>>> from gearmon.signals.reading import Wanted, interpret, read_file
>>> table = read_file("recording.csv", Wanted())                    # doctest: +SKIP
>>> interpret(table, Wanted())["units"][0]                          # doctest: +SKIP
'm/s2'

Text: `layout` (what a number is, separator, decimal character, first row, names) and `text` (bytes
to whole lines, lines to numbers, compiled or with care). Other files: `formats`, which gives
`arrays`, as frames and arrays in memory do. All end in a `Table` of `columns` (names, units, kinds,
defects); `channels` (the sampling rate, and which columns are the recording) interprets it.
"""

from gearmon.signals.reading.arrays import read_memory
from gearmon.signals.reading.channels import Wanted, interpret
from gearmon.signals.reading.columns import find_defect
from gearmon.signals.reading.formats import read_file

__all__ = ["Wanted", "find_defect", "interpret", "read_file", "read_memory"]
