"""Hill's equation of a gear mesh and its solvers; knows numbers, not gears.

>>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
>>> steady_state(p, tolerance=1e-6).error_bound < 1e-6
True
"""

from gearmon.dynamics.hill import HillProblem, Response
from gearmon.dynamics.steady_state import Method, steady_state

__all__ = ["HillProblem", "Method", "Response", "steady_state"]
