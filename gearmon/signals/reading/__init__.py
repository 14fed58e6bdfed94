"""Recordings in files: what kind of file, the numbers in it, and what they mean.

`gearmon.read_recording` takes these steps, each of which ends in numbers or in one clear line:

>>> from gearmon.signals.reading import identify, interpret, open_source, read_table, Wanted
>>> source = open_source("recording.csv")                           # doctest: +SKIP
>>> identify(source) is None  # it is text                          # doctest: +SKIP
True
>>> interpret(read_table(source), Wanted())["units"][0]   # doctest: +SKIP
'm/s2'

Text: `source` (bytes to whole lines, and what a number is), `layout` (separator, decimal character,
first row, names) and `text` (lines to numbers, compiled or with care). Other
files, arrays and frames: `formats`. Then for all: `columns` (names, units, kinds, defects),
`timebase` (the sampling rate) and `channels` (which columns are the recording).
"""

from gearmon.signals.reading.channels import Wanted, interpret
from gearmon.signals.reading.columns import find_defect
from gearmon.signals.reading.formats import identify, read_arrays
from gearmon.signals.reading.source import open_source
from gearmon.signals.reading.text import read_table

__all__ = [
    "Wanted",
    "find_defect",
    "identify",
    "interpret",
    "open_source",
    "read_arrays",
    "read_table",
]
