"""Lines of no gear: new or grown against healthy recordings, and what they may be.

Bearings, the mains, loose parts and unknown lines are found in the lists that
`gearmon.signatures.measured.nongear_lines` makes of each recording: `nongear_findings` compares a
measured signature with a reference, `disturbed` tells which orders of gears the findings spoil.
"""

from gearmon.diagnosis.nongear.lines import (
    PRIOR_CHANGE_DB,
    PRIOR_WORTH,
    NonGearFinding,
    compare_lines,
    disturbed,
    family_gain_db,
    nongear_findings,
    speed_scatter_db,
)
from gearmon.diagnosis.nongear.sources import harmonic_sources, name_lines

__all__ = [
    "PRIOR_CHANGE_DB",
    "PRIOR_WORTH",
    "NonGearFinding",
    "compare_lines",
    "disturbed",
    "family_gain_db",
    "harmonic_sources",
    "name_lines",
    "nongear_findings",
    "speed_scatter_db",
]
