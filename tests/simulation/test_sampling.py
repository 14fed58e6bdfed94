"""Triangle means and band limitation against exact integrals and Fourier series."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.simulation.integrate import SUBSTEPS, Course, MeshForces
from gearmon.simulation.vibration import FLAT_SHARE, band_spectrum, fade_ends, triangle_means


def forces_of(force, integral, times):
    """Exact impulses and end values of a force over steps."""
    pieces = len(times) - 1
    course = Course(
        times_s=times,
        interval=np.arange(pieces),
        start=np.zeros(pieces),
        width=np.ones(pieces),
        stiffness=np.zeros((1, 1, 1, pieces)),
        deviation=np.zeros((1, 1, pieces)),
        inputs=np.zeros((1, pieces + 1)),
    )
    share = np.arange(SUBSTEPS) / SUBSTEPS
    start = (times[:-1, None] + np.diff(times)[:, None] * share).ravel()
    end = np.append(start[1:], times[-1])

    def laid_out(row):
        return row[None].astype(np.float32)

    middle = 0.5 * (start + end)
    inside = 1e-6 * (end - start)
    return MeshForces(
        course=course,
        impulses_ns=laid_out(integral(end) - integral(start)),
        starts_n=laid_out(np.where(end > start, force(start + inside), force(middle))),
        ends_n=laid_out(np.where(end > start, force(end - inside), force(middle))),
        end_state=np.zeros((2, 1)),
        joint_mismatch=0.0,
    )


def uneven_times(end, pieces, seed=0):
    inner = np.sort(np.random.default_rng(seed).uniform(0, end, pieces - 1))
    return np.concatenate([[0.0], inner, [end]])


def test_quadratic_force_has_exact_means_between_uneven_steps():
    forces = forces_of(
        lambda t: 3 * t**2 + 4 * t - 5, lambda t: t**3 + 2 * t**2 - 5 * t, uneven_times(1.0, 40)
    )
    h = 0.01
    means, after = triangle_means(forces, 0.0, h, 100)
    t = h * np.arange(1, 100)
    # the triangle has the variance h^2 / 6
    assert means[0, 1:] == pytest.approx(3 * (t**2 + h**2 / 6) + 4 * t - 5, abs=2e-4)
    assert after.shape == (1,)


def test_sine_is_weakened_as_the_square_of_sinc():
    w, h = 2 * np.pi * 7, 0.005
    forces = forces_of(
        lambda t: np.sin(w * t), lambda t: -np.cos(w * t) / w, uneven_times(1.0, 200, 1)
    )
    means = triangle_means(forces, 0.25, h, 100)[0][0]
    t = 0.25 + h * np.arange(100)
    expected = np.sin(w * t) * np.sinc(w * h / (2 * np.pi)) ** 2
    assert means[1:] == pytest.approx(expected[1:], abs=3e-5)


def test_cells_may_be_taken_in_turns():
    forces = forces_of(np.sin, lambda t: -np.cos(t), uneven_times(1.0, 80, 2))
    whole = triangle_means(forces, 0.1, 0.01, 60)[0]
    first, carried = triangle_means(forces, 0.1, 0.01, 25)
    second, _ = triangle_means(forces, 0.1 + 25 * 0.01, 0.01, 35, carried)
    assert np.hstack([first, second]) == pytest.approx(whole, abs=1e-6)


def test_pieces_of_no_length_do_no_harm():
    times = np.sort(np.concatenate([np.linspace(0, 1, 9), np.linspace(0, 1, 9)[1:]]))
    forces = forces_of(lambda t: t, lambda t: t * t / 2, times)
    means = triangle_means(forces, 0.0, 0.1, 10)[0][0]
    assert means[1:] == pytest.approx(0.1 * np.arange(1, 10), abs=1e-6)


def test_cells_longer_than_chunks_are_met():
    forces = forces_of(lambda t: t, lambda t: t * t / 2, np.linspace(0, 1, 9))
    means = triangle_means(forces, 0.0, 0.4, 2)[0][0]
    assert means[1] == pytest.approx(0.4, abs=1e-6)


def triangle(phase_integral_2, cells):
    """Second differences of the second integral of a force over one period."""
    edges = np.arange(-1, cells + 1) / cells
    return np.diff(phase_integral_2(edges), 2) * cells**2


def test_jumps_of_a_square_wave_do_not_alias():
    periods, samples, oversampling = 37, 1000, 8
    cells = samples * oversampling

    def twice_integrated(t):
        # of a force that is 1 for 0.3 of each period, less its mean
        phase = t * periods
        x = phase - np.floor(phase)
        inside = np.where(
            x < 0.3, 0.7 * x**2 / 2, 0.7 * 0.045 + 0.21 * (x - 0.3) - 0.15 * (x - 0.3) ** 2
        )
        per_period = 0.7 * 0.045 + 0.21 * 0.7 - 0.15 * 0.49
        return (inside + per_period * np.floor(phase)) / periods**2

    means = triangle(twice_integrated, cells)
    found = band_spectrum(means[None], oversampling)[0] / samples
    n = np.arange(1, 11)
    expected = (1 - np.exp(-2j * np.pi * n * 0.3)) / (2j * np.pi * n)
    assert np.abs(found[n * periods] - expected).max() < 2e-4 * np.abs(expected).max()
    # nothing but its own harmonics up to four tenths of the rate rises above -80 dB
    others = np.delete(found[1:380], n * periods - 1)
    assert np.abs(others).max() < 1e-4 * np.abs(expected).max()


def test_line_in_the_flat_band_keeps_amplitude_and_phase():
    samples, oversampling, line = 200, 8, 60
    cells = samples * oversampling
    w = 2 * np.pi * line
    means = triangle(lambda t: -np.cos(w * t + 0.4) / w**2, cells)
    out = np.fft.irfft(band_spectrum(means[None], oversampling)[0], samples)
    assert out == pytest.approx(np.cos(2 * np.pi * line * np.arange(samples) / samples + 0.4))


def test_response_falls_to_nothing_at_half_the_rate():
    spectrum = band_spectrum(np.eye(1, 800), 8)[0]
    level = np.abs(spectrum * 8)
    assert level[: int(FLAT_SHARE * 100)] == pytest.approx(1.0, rel=0.03)
    assert level[-1] < 1e-12


def test_ends_are_faded_and_the_rest_is_left():
    rows = np.ones((2, 100))
    fade_ends(rows, 10)
    assert np.all(rows[:, 10:-10] == 1)
    assert np.all(np.diff(rows[0, :10]) > 0)
    assert np.array_equal(rows, rows[:, ::-1])
