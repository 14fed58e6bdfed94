from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.report.curves import (
    angle_spectrum,
    last_harmonic_hz,
    max_hold,
    time_spectrum,
    turn_waveform,
)
from gearmon.signatures.measured.reference import WheelPattern


@given(st.integers(1, 500), st.integers(1, 60), st.integers(0, 2**31))
def test_max_hold_keeps_the_largest_value_and_the_order(count, columns, seed):
    y = np.random.default_rng(seed).normal(size=count)
    x = np.arange(count, dtype=float)
    held_x, held_y = max_hold(x, y, columns)
    assert len(held_y) == min(count, columns)
    assert held_y.max() == y.max()
    assert np.all(np.diff(held_x) > 0)
    assert np.array_equal(y[held_x.astype(int)], held_y)


def test_curves_held_together_share_the_place_of_the_clearest():
    loud, soft = [100.0, 101.0, 100.0, 100.0, 99.0, 100.0], [0.0, 0.0, 1.0, 0.0, 0.5, 0.0]
    x, held = max_hold(np.arange(6.0), np.array([loud, soft]), 2)
    assert held.tolist() == [[101.0, 100.0], [1.0, 0.5]]
    # each beside its own highest: the second curve at 2, the first at 3 and 5
    assert x.tolist() == [1.0, 3.0]


@pytest.mark.parametrize("count", [4096, 300_000])
def test_a_sine_on_a_line_reads_its_amplitude_however_long(count):
    rate_hz = 4096.0
    signal = 1.5 + 2.5 * np.sin(2 * np.pi * 512.0 * np.arange(count) / rate_hz)
    spectrum, blocks = time_spectrum(signal[None, :], rate_hz)
    assert (blocks > 1) == (count > 2**17)
    at = int(np.argmax(spectrum.values[0]))
    assert spectrum.frequency_hz[at] == pytest.approx(512.0)
    assert spectrum.values[0, at] == pytest.approx(2.5, rel=1e-6)
    assert spectrum.values[0, 0] < 1e-9


def test_the_turn_without_mesh_harmonics_plus_the_mesh_harmonics_is_the_turn(faulty):
    signature = faulty.analysis.signature
    wheel = signature.plan.wheels[0]
    pattern, points = WheelPattern.of(wheel, signature.lines), 4 * int(wheel.number.max())
    average, rest = (turn_waveform(pattern, points, mesh=mesh) for mesh in (True, False))
    angle = np.arange(points) / points
    mesh = wheel.lines[wheel.mesh]
    number = wheel.number[wheel.mesh]
    waves = np.exp(2j * np.pi * np.outer(number, angle))
    assert np.allclose(average - rest, (signature.lines.mean[:, mesh] @ waves).real, atol=1e-9)


def test_the_angle_spectrum_reads_the_lines_of_the_analysis(faulty):
    signature = faulty.analysis.signature
    order, amplitude = angle_spectrum(faulty.analysis, faulty.recording, 60.0)
    assert order[-1] <= 60.0
    line = int(np.argmin(np.abs(signature.plan.orders - 23)))
    known = np.sqrt(signature.lines.cross_power()[:, line])
    near = amplitude[:, np.abs(order - 23) < 0.1].max(axis=1)
    # between two bins a Hann window reads up to 15 % too low
    np.testing.assert_allclose(near, known, rtol=0.16)


def test_neighbouring_lines_of_the_analysis_stand_in_bins_of_their_own(faulty):
    order, _ = angle_spectrum(faulty.analysis, faulty.recording, 60.0)
    lines = np.unique(faulty.analysis.signature.plan.orders.round(9))
    bins = np.rint(lines[lines < 60.0] / (order[1] - order[0]))
    assert len(bins) > 20
    assert (np.diff(bins) > 0).all()


def test_orders_end_where_the_sampling_rate_does(healthy):
    order, _ = angle_spectrum(healthy.analysis, healthy.recording, 1e4)
    fastest = healthy.analysis.signature.track.speed_hz.max()
    assert order[-1] * fastest <= 0.45 * healthy.recording.sampling_rate_hz


def test_a_spectrum_reaches_beyond_the_last_harmonic_of_every_mesh(healthy):
    signature = healthy.analysis.signature
    (mesh,) = signature.meshes
    slow = replace(mesh, frequency_hz=mesh.frequency_hz / 3)
    ends = [last_harmonic_hz(replace(signature, meshes=(own,))) for own in (mesh, slow)]
    assert ends[0] != ends[1]
    for own, end in zip((mesh, slow), ends, strict=True):
        # an eighth beyond a whole number of harmonics
        harmonics = end / own.frequency_hz / 1.12
        assert harmonics == pytest.approx(round(harmonics))
        assert harmonics > 3.0
    for meshes in ((mesh, slow), (slow, mesh)):
        assert last_harmonic_hz(replace(signature, meshes=meshes)) == max(ends)
