"""Signatures: order lines with amplitude, phase and origin.

`expected` holds what a machine file foretells, healthy and with every fault of its gears;
`measured` what recordings show of the same lines, and the healthy reference that they make;
`signature` the table of lines that is written and read.

>>> from gearmon.signatures.signature import COLUMNS
>>> COLUMNS[:4]
('stage', 'mesh_harmonic', 'sideband', 'sideband_of')
"""
