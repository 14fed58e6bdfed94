"""Recordings in files: what kind of file, the numbers in it, and what they mean.

`gearmon.read_recording` takes these steps, each of which ends in numbers or in one clear line:

>>> from gearmon.signals.reading import identify, interpret, open_source, read_table, Wanted
>>> source = open_source("recording.csv")                           # doctest: +SKIP
>>> identify(source).is_text                                        # doctest: +SKIP
True
>>> interpret(read_table(source).content(), Wanted()).columns[0].unit   # doctest: +SKIP
'm/s2'

Text: `source` (bytes to whole lines), `fields` (what a number is), `dialect`, `header` and `units`
(separator, decimal character, first row, names), `rows` (lines to numbers, compiled or with care),
`table` (all of them). Other files: `formats`. Then for all: `columns` (names,
units, kinds), `timebase` (the sampling rate), `quality` (dead or clipped channels) and `roles`
(which columns are the recording).
"""

from gearmon.signals.reading.columns import Column, Content, describe_columns, find_column
from gearmon.signals.reading.fields import Floats
from gearmon.signals.reading.formats import Format, Frames, choose, identify, load
from gearmon.signals.reading.quality import find_defect, survey
from gearmon.signals.reading.roles import Interpreted, SensorLike, Wanted, interpret
from gearmon.signals.reading.source import Source, open_source
from gearmon.signals.reading.table import Progress, Table, read_table
from gearmon.signals.reading.timebase import counts_evenly, rises_evenly, spacing

__all__ = [
    "Column",
    "Content",
    "Floats",
    "Format",
    "Frames",
    "Interpreted",
    "Progress",
    "SensorLike",
    "Source",
    "Table",
    "Wanted",
    "choose",
    "counts_evenly",
    "describe_columns",
    "find_column",
    "find_defect",
    "identify",
    "interpret",
    "load",
    "open_source",
    "read_table",
    "rises_evenly",
    "spacing",
    "survey",
]
