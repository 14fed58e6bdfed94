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

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "Signature": "signature",
    "expected_signature": "expected.baseline",
    "fault_family": "expected.fault_family",
    "indicator_table": "measured.indicators",
    "loss_response": "expected.faulty_teeth",
    "make_reference": "measured.reference",
    "measure_signature": "measured.measurement",
    "mesh_problem": "expected.mesh",
    "read_reference": "measured.reference",
    "read_signature": "signature",
    "tooth_response": "expected.tooth_response",
    "write_reference": "measured.reference",
    "write_signature": "signature",
}

__all__ = [*_HOMES]


def __getattr__(name: str) -> Any:
    """Load a public name from its module."""
    if name not in _HOMES:
        raise AttributeError(f"module 'gearmon.signatures' has no attribute {name!r}")
    return getattr(import_module(f"gearmon.signatures.{_HOMES[name]}"), name)
