"""Signatures: order lines with amplitude, phase and origin.

`expected` holds what a machine file foretells, healthy and with every fault of its gears;
`measured` what recordings show of the same lines, and the healthy reference that they make;
`signature` the table of lines that is written and read. Names load their module when first used.

Examples
--------
>>> from gearmon.signatures import expected_signature, make_reference, measure_signature
>>> from gearmon.signatures import mesh_problem, tooth_response
>>> cracked = expected_signature(machine, ["crack:1:pinion:5:20%"], max_hz=2000.0)
>>> sorted(set(cracked["sideband_of"].tolist()))
['', 'pinion']
>>> make_reference([measure_signature(own, machine) for own in (half, full)], machine).origins
('simulated', 'simulated')
>>> round(1 / mesh_problem(machine).period_s)
567
>>> tooth_response(machine, 1, "pinion", max_order=50.0).teeth
23
"""

from gearmon.lazy import lazily

_OFFERED = {
    "expected.baseline": ("expected_signature",),
    "expected.fault_family": ("fault_family",),
    "expected.mesh": ("mesh_problem",),
    "expected.tooth_response": ("loss_response", "tooth_response"),
    "measured.indicators": ("indicator_table",),
    "measured.measurement": ("measure_signature",),
    "measured.reference": ("make_reference", "read_reference", "write_reference"),
    "signature": ("Signature", "read_signature", "write_signature"),
}

__all__, __getattr__ = lazily(__name__, _OFFERED)
