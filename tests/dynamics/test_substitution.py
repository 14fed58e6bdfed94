from dataclasses import replace

import numpy as np
import pytest
from reference.hill_cases import published_pair, scaled_problem

from gearmon.dynamics.multiple_scales import expand
from gearmon.errors import ArgumentError


@pytest.mark.parametrize("small_damping", [False, True])
def test_arrays_give_the_same_as_expansions_one_by_one(small_damping):
    p = scaled_problem(3.3, 0.02, [0.1, 0.05j, -0.02], [50 + 20j, 3j])
    expansion = expand(p, 3, small_damping=small_damping)
    mass = np.array([0.2, 0.28, 0.5])
    damping = np.array([[500.0], [2e3]])
    found = expansion.substitute(
        mass_kg=mass,
        damping_ns_per_m=damping,
        stiffness_n_per_m=7e8,
        period_s=1.1 * p.period_s,
        force_n=[1e3, 2e3, 3e3],
        variation=0.7,
    )
    assert found.shape == (2, 3, expansion.terms.shape[1])
    for i in range(2):
        for j in range(3):
            one = replace(
                p,
                mass_kg=mass[j],
                damping_ns_per_m=damping[i, 0],
                stiffness_n_per_m=7e8,
                period_s=1.1 * p.period_s,
                force_n=(1e3, 2e3, 3e3)[j],
                stiffness_harmonics=0.7 * p.stiffness_harmonics,
            )
            alone = expand(one, 3, small_damping=small_damping).displacement
            np.testing.assert_allclose(found[i, j], alone, atol=1e-14 * np.abs(alone).max())


def test_the_problem_itself():
    expansion = expand(published_pair(), 4)
    z = expansion.displacement
    np.testing.assert_allclose(expansion.substitute(), z, atol=1e-15 * abs(z[0]))


def test_many_sets_in_parts():
    expansion = expand(published_pair(5), 3)
    mass = np.linspace(0.2, 1.0, 9000)
    found = expansion.substitute(mass_kg=mass)
    for at in (0, 4321, 8999):
        alone = expansion.substitute(mass_kg=mass[at])
        np.testing.assert_allclose(found[at], alone, atol=1e-15 * abs(alone[0]))


def test_refusals():
    expansion = expand(published_pair(5), 1)
    with pytest.raises(ArgumentError, match=r"mass_kg\[1\]=-1\.0 kg must be > 0"):
        expansion.substitute(mass_kg=[1.0, -1.0])
    with pytest.raises(ArgumentError, match="damping_ns_per_m=nan"):
        expansion.substitute(damping_ns_per_m=np.nan)
    with pytest.raises(ArgumentError, match="broadcast"):
        expansion.substitute(mass_kg=[1.0, 2.0], force_n=[1.0, 2.0, 3.0])
    p = replace(expansion.problem, period_s=1.0, mass_kg=1.0, stiffness_n_per_m=1.0)
    undamped = expand(replace(p, damping_ns_per_m=0.0), 1, highest=1)
    with pytest.raises(ArgumentError, match="harmonic 1 lies on the natural frequency"):
        undamped.substitute(stiffness_n_per_m=(2 * np.pi) ** 2)
