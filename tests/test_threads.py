"""Tasks side by side: results in order, the same whatever the number of cores."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from reference.synthetic_signals import constant_track, lines_on, white

from gearmon import threads
from gearmon.signals.orders import InAngle, OrderBlocks, OrderSums, fine_order_spectrum
from gearmon.signals.orders.spectra import fine_envelope_spectrum
from gearmon.threads import alone_on_a_core, at_once, cores, side_by_side

RATE, SPEED = 2000.0, 20.0


@pytest.mark.parametrize("work", [0, 1 << 40])
def test_tasks_side_by_side_give_results_in_order(work):
    assert side_by_side(lambda number: number**2, range(50), work) == [n**2 for n in range(50)]


@pytest.mark.parametrize("work", [0, 1 << 40])
def test_two_tasks_give_both_results(work):
    assert at_once(lambda: "one", lambda: 2, work) == ("one", 2)


@pytest.mark.parametrize("work", [0, 1 << 40])
def test_errors_of_tasks_are_raised(work):
    def fails():
        raise ValueError("no such thing")

    with pytest.raises(ValueError, match="no such thing"):
        at_once(lambda: 1, fails, work)


def test_numbers_do_not_depend_on_the_number_of_cores(monkeypatch):
    track = constant_track(SPEED, 30.0)
    samples = lines_on(SPEED * np.arange(60_000) / RATE, [9.0, 13.7], [1.0, 0.3])
    samples = samples + white((2, 60_000), seed=1)

    def results():
        orders = np.linspace(0.5, 44.0, 60)
        lines = OrderBlocks(samples, RATE, track, orders, 20.0).lines()
        yield from (lines.amplitude, lines.noise)
        sums = OrderSums(samples, RATE, np.array([9.0, 18.0, 27.0]))
        yield from (sums.noise(track, 8.0), sums.sliding(track, 4.0).amplitude)
        yield fine_order_spectrum(InAngle.of(samples, RATE, track), 5).power
        yield fine_envelope_spectrum(InAngle.of(samples, RATE, track), 8.0, 5).power

    monkeypatch.setattr(threads, "_WORTH_THREADS", 0)
    alone, *others = [
        [value.tobytes() for value in _with_cores(monkeypatch, cores, results)]
        for cores in (1, 2, 3)
    ]
    assert all(other == alone for other in others)


def _with_cores(monkeypatch, cores, results):
    monkeypatch.setattr(threads, "cores", lambda: cores)
    return list(results())


@pytest.mark.parametrize("way", ["fork", "forkserver", "spawn"])
def test_a_process_begun_in_any_way_keeps_to_its_core_and_works(way):
    """Python 3.14 begins processes by a server, which is then their parent by number."""
    with ProcessPoolExecutor(1, get_context(way), alone_on_a_core) as pool:
        assert pool.submit(cores).result(timeout=60) == 1
