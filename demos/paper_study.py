"""The vibration of a gear mesh by multiple scales, order by order, against the exact answer.

The equation of a pair of gears is Hill's: m z'' + c z' + k0 [1 + eps f(t)] z = F, with a stiffness
that changes as one or two pairs of teeth carry. A published study solves it by an expansion in eps
to the second order. How good is that? (`gearmon demo study` asks this of all its claims.)

Run it as it stands: python demos/paper_study.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from gearmon.dynamics import HillProblem, steady_state

# The pair of the study: 26 and 53 teeth, a square wave of 13 % between two pairs and one.
EPS, PERIOD_S = 0.13, 1.6e-3
ORDERS = np.arange(1, 42)
SQUARE_WAVE = np.where(ORDERS % 2 == 1, -2j / (np.pi * ORDERS), 0.0)


def pair(damping_ns_per_m):
    return HillProblem(0.28, damping_ns_per_m, 8e8, EPS * SQUARE_WAVE, PERIOD_S, 4e3)


def main():
    problem = pair(9e3)
    print(f"natural frequency {problem.natural_frequency_hz:.0f} Hz, mesh {1 / PERIOD_S:.0f} Hz")

    # The exact answer comes with a bound of its own error: nobody has to believe it.
    exact = steady_state(problem, tolerance=1e-9)
    print(f"exact: {exact.method}, relative error of the acceleration <= {exact.error_bound:.1e}")

    time = np.linspace(0.0, PERIOD_S, 801)
    figure, (motion, errors) = plt.subplots(1, 2, layout="constrained", figsize=(10, 4))
    motion.plot(1e3 * time, 1e6 * exact.at(time), "k--", label="exact")
    found = []
    for order in range(1, 7):
        response = steady_state(problem, method="msm", order=order)
        off = response.at(time, "acceleration") - exact.at(time, "acceleration")
        found.append(np.linalg.norm(off) / np.linalg.norm(exact.at(time, "acceleration")))
        print(f"order {order}: acceleration wrong by {found[-1]:.1%}")
        if order <= 2:
            motion.plot(1e3 * time, 1e6 * response.at(time), label=f"order {order}")
    motion.set(xlabel="time in ms", ylabel="displacement in µm")
    motion.legend()
    errors.semilogy(range(1, 7), found, "o-")
    errors.set(xlabel="order", ylabel="relative error of the acceleration")
    path = Path("gearmon-multiple-scales.png")
    figure.savefig(path)
    print("picture:", path)


if __name__ == "__main__":
    main()
