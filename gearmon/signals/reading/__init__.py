"""Recordings in text files: what kind of file, which dialect, the numbers, and what they mean.

In the order of reading: `source` (bytes to lines), `formats` (is it text at all?), `fields` (what a
number is), `dialect` and `header` (separator, decimal character, first row, names), `plain`,
`short_fields`, `digits` and `rounding` (whole blocks to numbers), `careful` (line by line, to say
what is wrong), `table` (all rows), `columns` and `units` (names, units, kinds), `timebase` and
`rate` (the sampling rate), `quality` (dead or clipped channels), `roles` (which columns are used).
"""
