"""Hill's equation of one gear mesh, or of several in one machine; knows numbers, not gears.

`steady_state` solves one problem, `sweep.sweep` thousands; `expand` shows the orders of the
expansion, `transient` and `integrate` what happens before the steady state. Names load their module
when first used. More stands in the modules: `stability`, `sweep`, ...

Examples
--------
>>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
>>> found = steady_state(p, tolerance=1e-6)
>>> isinstance(found, Response), found.error_bound < 1e-6, found.contact_lost
(True, True, False)
>>> free = HillSystem([[0.28]], [[9e3]], [[0.0]], [[1.0]], [8e8], [[0.065]], 1.6e-3, [4e3])
>>> isinstance(steady_state(free), SystemResponse)
True
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearmon.dynamics.hill import HillProblem, Response
from gearmon.dynamics.steady_state import Method, steady_state
from gearmon.dynamics.system import HillSystem, SystemResponse
from gearmon.lazy import lazily

if TYPE_CHECKING:
    from gearmon.dynamics.amplitude_equations import forced_resonance as forced_resonance
    from gearmon.dynamics.amplitude_equations import parametric_resonance as parametric_resonance
    from gearmon.dynamics.amplitude_equations import transient as transient
    from gearmon.dynamics.multiple_scales import expand as expand
    from gearmon.dynamics.stability import stability_chart as stability_chart
    from gearmon.dynamics.system import combination_tongues as combination_tongues
    from gearmon.dynamics.system import integrate as integrate

_OFFERED = {
    "amplitude_equations": ("forced_resonance", "parametric_resonance", "transient"),
    "multiple_scales": ("expand",),
    "stability": ("stability_chart",),
    "system": ("combination_tongues", "integrate"),
}

_NAMES, __getattr__ = lazily(__name__, _OFFERED)

__all__ = [
    "HillProblem",
    "HillSystem",
    "Method",
    "Response",
    "SystemResponse",
    "steady_state",
    *_NAMES,
]
