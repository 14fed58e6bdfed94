import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.hill_cases import published_pair, scaled_problem

from gearmon.dynamics import multiple_scales
from gearmon.dynamics.multiple_scales import expand, paths
from gearmon.errors import ArgumentError

PARTS = st.floats(-0.1, 0.1).filter(lambda x: x == 0 or abs(x) > 1e-6)


@given(
    st.lists(st.builds(complex, PARTS, PARTS), min_size=1, max_size=3),
    st.floats(0.3, 5.0),
    st.booleans(),
)
def test_paths_sum_to_the_term(harmonics, ratio, small_damping):
    p = scaled_problem(ratio + 1e-3, 0.05, harmonics, [40 - 10j])
    expansion = expand(p, 3, small_damping=small_damping)
    for order in range(4):
        size = np.abs(expansion.terms[order]).max()
        for line in range(min(4, expansion.terms.shape[1])):
            found = paths(expansion, line, order)
            total = sum(path.contribution for path in found)
            assert total == pytest.approx(expansion.terms[order, line], abs=1e-12 * size)
            assert all(path.order == order for path in found)


def test_contribution_is_the_product_of_its_steps():
    p = scaled_problem(3.3, 0.05, [0.1, 0.05j, 0.02])
    c = {j: p.stiffness_harmonics[j - 1] for j in (1, 2, 3)}
    c |= {-j: c[j].conjugate() for j in (1, 2, 3)}
    for path in paths(expand(p, 3), 4, 3):
        value = (-1) ** 3 * p.force_n / p.stiffness_n_per_m * np.prod(path.gains)
        for step in path.steps:
            value *= c[step]
        assert path.contribution == pytest.approx(value, rel=1e-12)
        assert np.array_equal(np.diff(path.lines), path.steps)
        assert path.lines[0] == 0
        assert path.lines[-1] == 4


def test_largest_are_the_largest_of_all():
    p = scaled_problem(3.3, 0.05, [0.1, 0.05j, 0.02, -0.01], [30.0])
    expansion = expand(p, 3)
    everything = paths(expansion, 2, 3)
    best = paths(expansion, 2, 3, most=7)
    assert [path.steps for path in best] == [path.steps for path in everything[:7]]


def test_origin_of_the_lines_of_the_published_pair():
    expansion = expand(published_pair(9), 2)
    # odd harmonics only: line 2 is made of pairs of them, c_1 twice above all
    assert not paths(expansion, 2, 1)
    largest = paths(expansion, 2, 2)[0]
    assert largest.text == "(F/k0) (c_1/D_1) (c_1/D_2)"
    assert largest.lines == (0, 1, 2)
    assert paths(expansion, 3, 1)[0].text == "-(F/k0) (c_3/D_3)"


def test_small_damping_takes_steps():
    expansion = expand(scaled_problem(3.3, 0.05, [0.1]), 2, small_damping=True)
    found = [path.text for path in paths(expansion, 1, 2)]
    assert found == ["(F/k0) (c_1/D_1) (2i zeta n/R/D_1)"]


def test_a_direct_force_is_a_source():
    expansion = expand(scaled_problem(3.3, 0.05, [0.1], [10.0, 20j]), 1)
    assert [path.text for path in paths(expansion, 2, 0)] == ["(f_2/k0/D_2)"]
    assert {path.lines for path in paths(expansion, 0, 1)} == {(1, 0), (-1, 0)}


def test_refusals():
    expansion = expand(published_pair(41), 5, highest=60)
    with pytest.raises(ArgumentError, match="most=20"):
        paths(expansion, 3, 5)
    with pytest.raises(ArgumentError, match="line=61"):
        paths(expansion, 61, 2)
    with pytest.raises(ArgumentError, match="order=6"):
        paths(expansion, 3, 6)
    assert len(paths(expansion, 3, 3, most=5)) == 5


@pytest.mark.parametrize("line", [0, 1, 3])
def test_as_many_terms_as_are_allowed_are_made(line, monkeypatch):
    expansion = expand(scaled_problem(3.3, 0.05, [0.1, 0.05], [10.0]), 4, small_damping=True)
    count = len(paths(expansion, line, 4))
    assert count > 20
    monkeypatch.setattr(multiple_scales, "MOST_PATHS", count)
    assert len(paths(expansion, line, 4)) == count
    monkeypatch.setattr(multiple_scales, "MOST_PATHS", count - 1)
    with pytest.raises(ArgumentError, match=f"more than {count - 1} terms"):
        paths(expansion, line, 4)
