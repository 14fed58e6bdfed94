"""Measures of one recording: closed forms, a slow version, laws, and what is refused."""

from __future__ import annotations

import re
from statistics import stdev

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearmon
from gearmon.errors import GearmonError
from gearmon.exposure import LIMITS, POSITIONS, WEIGHTINGS, Limits, measures, seat_factor
from gearmon.signals.recording import Recording

RATE = 1000.0


def recorded(*rows, rate=RATE, names=("x", "y", "z"), unit="m/s2"):
    rows = np.atleast_2d(np.array(rows, dtype=float))
    names, units = names[-len(rows) :], (unit,) * len(rows)
    return Recording(
        samples=rows, sampling_rate_hz=rate, channel_names=names, units=units, origin="seat.csv"
    )


def felt(*rows, position="seat", **how):
    known = {key: how.pop(key) for key in ("rate", "names", "unit") if key in how}
    return gearmon.vibration_exposure(recorded(*rows, **known), position, **how)


def time_of(seconds, rate=RATE):
    return np.arange(round(seconds * rate)) / rate


def sine(frequency, rms=1.0, seconds=60.0, rate=RATE):
    # a little noise: samples that are exactly alike, period by period, look clipped
    time = time_of(seconds, rate)
    rounding = 1e-6 * rms * np.random.default_rng(0).normal(size=len(time))
    return rms * np.sqrt(2) * np.sin(2 * np.pi * frequency * time) + rounding


def noise(seconds, seed=0, rate=RATE):
    return np.random.default_rng(seed).normal(size=(3, round(seconds * rate)))


def shock(at=30.0, seconds=60.0, width=0.1, height=20.0):
    """Half a sine of a width [s] and height [m/s2]."""
    late = time_of(seconds) - at
    struck = (late >= 0) & (late <= width)
    return np.where(struck, height * np.sin(np.pi * late / width), 0.0) + 1e-9 * noise(seconds)[0]


def slowly_weighted(samples, name, rate=RATE, denser=8):
    """The analogue response on the transform of the whole, with room for it to ring out.

    Between the samples as well, so that peaks and fourth powers are those of the curve.
    """
    count, own = len(samples), WEIGHTINGS[name]
    whole = np.concatenate([samples - samples.mean(), np.zeros(round(60 * rate))])
    lines = np.fft.rfft(whole) * own.response(np.fft.rfftfreq(len(whole), 1 / rate))
    return np.fft.irfft(lines, denser * len(whole))[: denser * count] * denser


@pytest.mark.parametrize("frequency", [1.0, 4.0, 10**0.8, 16.0, 80.0])
@pytest.mark.parametrize("rate", [256.0, 1000.0, 20_000.0])
def test_a_sine_of_1_reads_the_weighting(frequency, rate):
    rows = [sine(frequency, seconds=40.0, rate=rate)] * 3
    found = felt(*rows, rate=rate)
    for axis in found.axes:
        gain = abs(WEIGHTINGS[axis.weighting].response(frequency))
        assert axis.rms_ms2 == pytest.approx(gain, rel=0.012)
        assert axis.factor == POSITIONS["seat"][axis.axis][1]
    counted = [axis.factor * axis.rms_ms2 for axis in found.axes]
    assert found.value_ms2 == max(counted)
    assert found.vector_sum_ms2 == pytest.approx(np.linalg.norm(counted))
    assert found.vdv == max(axis.factor * axis.vdv for axis in found.axes)


def test_a_hand_counts_all_axes_alike():
    found = felt(*[sine(80.0, 5.0, rate=8000.0)] * 3, rate=8000.0, position="hand")
    assert found.value_axis == "vector sum"
    assert found.vdv is None
    expected = np.sqrt(3) * 5.0 * abs(WEIGHTINGS["Wh"].response(80.0))
    assert found.value_ms2 == pytest.approx(expected, rel=2e-3)


def test_a_steady_sine_has_the_measures_of_the_book():
    """Crest sqrt 2, MTVV the rms, and the mean fourth power of a sine is 3/2 of rms^4."""
    rising = np.minimum(time_of(300.0) / 3.0, 1.0)  # a filter that is switched on overshoots
    found = felt(rising * sine(8.0, 2.0, seconds=300.0))
    axis, gain = found.axes[0], 2.0 * abs(WEIGHTINGS["Wk"].response(8.0))
    assert axis.peak_ms2 == pytest.approx(gain * np.sqrt(2), rel=2e-3)
    assert axis.mtvv_ms2 == pytest.approx(gain, rel=2e-3)
    # means of t^2 and t^4 over the rise are 1/3 and 1/5
    assert axis.rms_ms2 == pytest.approx(gain * np.sqrt(298.0 / 300.0), rel=1e-3)
    assert axis.crest_factor == axis.peak_ms2 / axis.rms_ms2
    assert axis.vdv == pytest.approx(gain * (1.5 * 297.6) ** 0.25, rel=1e-3)
    assert not found.advice


def test_white_noise_has_the_integral_of_the_weighting():
    """Rms^2 = integral of S |W|^2, S = 2 variance / rate; 20 minutes know it to half a per cent."""
    found = felt(*noise(1200.0))
    f = np.linspace(1e-3, RATE / 2, 400_000)
    for axis in found.axes:
        own = np.abs(WEIGHTINGS[axis.weighting].response(f)) ** 2
        expected = np.sqrt(2 / RATE * own.sum() * (f[1] - f[0]))
        assert axis.rms_ms2 == pytest.approx(expected, rel=0.02)
        assert axis.square_scatter == pytest.approx(0.01, abs=0.008)


@pytest.mark.parametrize(("seconds", "stretches"), [(12.0, 2), (43.0, 8), (150.0, 20)])
def test_the_scatter_of_a_mean_is_that_of_its_stretches(seconds, stretches):
    """Up to twenty of them, of five seconds at least, by the estimate without bias."""
    found = felt(noise(seconds)[0])
    squares = np.array_split(found.running_ms2[0] ** 2 / found.axes[0].factor ** 2, stretches)
    means = [own.mean() for own in squares]
    expected = stdev(means) / np.sqrt(stretches) / np.mean(means)
    assert found.axes[0].square_scatter == pytest.approx(expected, rel=1e-9)


def test_a_step_leaves_the_energy_of_its_transform():
    """A step of h has |X| = h / (2 pi f): its energy is twice the integral of |W X|^2."""
    step = np.where(time_of(60.0) < 30.0, 0.0, 3.0) + 1e-9 * noise(60.0)[0]
    axis = felt(step).axes[0]
    f = np.geomspace(1e-3, 500.0, 200_000)
    power = np.abs(WEIGHTINGS["Wk"].response(f) * 3.0 / (2 * np.pi * f)) ** 2
    expected = 2 * np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(f))
    assert axis.rms_ms2**2 * 60.0 == pytest.approx(expected, rel=5e-3)


def test_the_dose_of_a_shock_by_hand():
    """Integral of the fourth power of the exact answer, between the samples as well."""
    axis = felt(shock()).axes[0]
    exact = slowly_weighted(shock(), "Wk")
    assert axis.vdv == pytest.approx((np.sum(exact**4) / (8 * RATE)) ** 0.25, rel=2e-3)
    assert axis.peak_ms2 == pytest.approx(np.abs(exact).max(), rel=2e-3)
    told = felt(shock()).advice
    assert [own.split(" above")[0] for own in told] == [
        "crest factor",
        "MTVV over rms",
        "VDV over rms T^(1/4)",
    ]


@pytest.mark.parametrize(
    ("name", "most", "of"),
    [
        ("crest factor", 9.0, lambda axis: axis.crest_factor),
        ("MTVV over rms", 1.5, lambda axis: axis.mtvv_ms2 / axis.rms_ms2),
        ("VDV over rms T^(1/4)", 1.75, lambda axis: axis.vdv / axis.rms_ms2 / 60**0.25),
    ],
)
def test_advice_begins_where_the_standard_says(name, most, of):
    """ISO 2631-1: 9 (6.2.1), 1.5 and 1.75 (6.3.3), by shocks of growing height beside a sine."""
    asked = []
    for height in np.geomspace(0.5, 40.0, 12):
        found = felt(shock(height=height) + sine(8.0, 0.3))
        above = of(found.axes[0]) > most
        assert above == any(told.startswith(f"{name} above {most:g}") for told in found.advice)
        asked.append(above)
    assert set(asked) == {True, False}


def test_factors_are_those_of_the_standards():
    """ISO 2631-1: 7.2.3 (seat), 8.2.2 (comfort: backrest, feet); ISO 5349-1 (hand)."""
    told = {
        "seat": "Wd 1.4, Wd 1.4, Wk 1",
        "standing": "Wd 1, Wd 1, Wk 1",
        "backrest": "Wc 0.8, Wd 0.5, Wd 0.4",
        "feet": "Wk 0.25, Wk 0.25, Wk 0.4",
        "building": "Wm 1, Wm 1, Wm 1",
        "hand": "Wh 1, Wh 1, Wh 1",
    }
    for position, axes in POSITIONS.items():
        assert list(axes) == ["x", "y", "z"]
        assert ", ".join(f"{name} {k:g}" for name, k in axes.values()) == told[position]


@pytest.mark.parametrize("name", ["Wk", "Wd", "Wc", "Wm", "Wh"])
def test_the_slow_version_agrees(name):
    position, axis = {
        "Wk": ("seat", "z"), "Wd": ("seat", "x"), "Wc": ("backrest", "x"), "Wm": ("building", "y"),
        "Wh": ("hand", "y"),
    }[name]  # fmt: skip
    rate = 8000.0 if name == "Wh" else RATE
    samples = noise(60.0, seed=4, rate=rate)[0] * (1 + 3 * (time_of(60.0, rate) > 40.0))
    found = felt(samples, rate=rate, names=(axis,), position=position).axes[0]
    exact = slowly_weighted(samples, name, rate)
    squares = np.cumsum(exact**2) / (8 * rate)
    window = round(8 * rate)
    assert found.weighting == name
    assert found.rms_ms2 == pytest.approx(np.sqrt(np.mean(exact**2)), rel=2e-3)
    assert found.vdv == pytest.approx((np.sum(exact**4) / (8 * rate)) ** 0.25, rel=2e-3)
    assert found.mtvv_ms2 == pytest.approx(
        np.sqrt((squares[window:] - squares[:-window]).max()), rel=3e-3
    )
    assert found.peak_ms2 == pytest.approx(np.abs(exact).max(), rel=0.01)


@given(block=st.integers(1, 40_000), seconds=st.floats(5.0, 30.0))
def test_blocks_of_any_length_make_one_piece(block, seconds):
    rows, whole = noise(seconds, seed=1), felt(*noise(seconds, seed=1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measures, "_BLOCK", block)
        parts = felt(*rows)
    for one, other in zip(whole.axes, parts.axes, strict=True):
        for name, value in vars(one).items():
            assert getattr(other, name) == (
                pytest.approx(value, rel=1e-9) if isinstance(value, float) else value
            )
    np.testing.assert_allclose(parts.running_ms2, whole.running_ms2, rtol=1e-9)


@given(scale=st.floats(1e-3, 1e3), offset=st.floats(20.0, 50.0))
def test_all_scales_with_the_channel_and_no_offset_counts(scale, offset):
    one, other = felt(noise(20.0)[0]).axes[0], felt(scale * noise(20.0)[0]).axes[0]
    for name in ("rms_ms2", "peak_ms2", "mtvv_ms2", "vdv"):
        assert getattr(other, name) == pytest.approx(scale * getattr(one, name), rel=1e-9)
    for name in ("crest_factor", "square_scatter", "fourth_scatter"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-9)
    shifted = felt(noise(20.0)[0] + offset).axes[0]
    assert shifted.rms_ms2 == pytest.approx(one.rms_ms2, rel=1e-6)
    assert shifted.mean_ms2 == pytest.approx(one.mean_ms2 + offset)


def test_slow_drift_is_not_felt():
    drift = np.linspace(0.0, 5.0, round(300 * RATE))
    assert felt(noise(300.0)[0] + drift).value_ms2 == pytest.approx(
        felt(noise(300.0)[0]).value_ms2, rel=2e-3
    )


def test_axes_are_told_by_name_number_or_heading():
    rows = [sine(4.0, rms) for rms in (1.0, 2.0, 3.0)]
    plain = felt(*rows)
    named = felt(*rows, names=("a", "b", "c"), axes={"x": "a", "y": "b", "z": "c"})
    turned = felt(*rows[::-1], names=("a", "b", "c"), axes={"z": 1, "y": 2, "x": 3})
    headed = felt(*rows, names=("Seat_X", "seat ay", "acc z"))
    for other in (named, turned, headed):
        assert [a.rms_ms2 for a in other.axes] == [a.rms_ms2 for a in plain.axes]
    assert [a.channel for a in turned.axes] == ["c", "b", "a"]
    assert any("axes not measured: x, y" in told for told in felt(rows[2]).warnings)


def test_the_running_rms_is_weighted_and_counted_with_the_factor_of_its_axis():
    """A steady sine has the same rms every second: 1.4 times that of the axis on x and y."""
    found = felt(*[sine(4.0)] * 3)
    for axis, course in zip(found.axes, found.running_ms2, strict=True):
        np.testing.assert_allclose(course[5:], axis.factor * axis.rms_ms2, rtol=5e-3)
    assert [axis.factor for axis in found.axes] == [1.4, 1.4, 1.0]


@pytest.mark.parametrize(("position", "low", "high"), [("seat", 0.5, 80.0), ("hand", 8.0, 1000.0)])
@pytest.mark.parametrize("times", [2.5, 10.0])
def test_third_octaves_go_a_band_beyond_what_is_counted_or_as_far_as_the_rate(
    position, low, high, times
):
    """Centres 10^(n/10); the last ends below half the rate and the next would not."""
    rate = times * high
    own = felt(noise(15.0, rate=rate)[0], position=position, rate=rate)
    bands = 10 * np.log10(own.band_hz)
    np.testing.assert_allclose(bands, np.round(bands[0]) + np.arange(len(bands)), atol=1e-9)
    assert own.band_hz[0] == pytest.approx(low, rel=0.03)
    assert own.band_hz[-1] * 10**0.05 <= rate / 2 * (1 + 1e-9)
    beyond = own.band_hz[-1] >= 1.2 * high
    assert beyond or own.band_hz[-1] * 10**0.15 > rate / 2
    assert own.band_hz[-1] < 1.3 * high
    assert own.band_ms2.shape == (1, len(bands))


def test_third_octaves_hold_what_was_recorded():
    found = felt(sine(10**0.6, 2.0, seconds=300.0) + 9.81)
    band = np.argmin(np.abs(found.band_hz - 10**0.6))
    assert found.band_ms2[0, band] == pytest.approx(2.0, rel=1e-3)
    assert np.delete(found.band_ms2[0], band).max() < 1e-3
    assert found.weighted_band_ms2[0, band] == pytest.approx(2 * 0.9648, rel=2e-3)
    loud = felt(*noise(300.0))
    width = 10**0.05 - 10**-0.05
    expected = np.sqrt(2 / RATE * loud.band_hz * width)
    np.testing.assert_allclose(loud.band_ms2[0], expected, rtol=0.25)


@pytest.mark.parametrize("edge_hz", [10**0.55, 10**0.85])
def test_a_sine_on_the_edge_of_two_bands_is_halved(edge_hz):
    found = felt(sine(edge_hz, 2.0, seconds=300.0))
    above = int(np.searchsorted(found.band_hz, edge_hz))
    halves = found.band_ms2[0, above - 1 : above + 1] ** 2
    assert halves.sum() == pytest.approx(4.0, rel=2e-3)
    assert halves[0] == pytest.approx(halves[1], rel=0.15)


def test_time_to_the_values_of_the_directive():
    found = felt(sine(8.0, 1.0, seconds=300.0))
    times = found.times_s()
    assert times["action_ms2"] == pytest.approx(8 * 3600 * (0.5 / found.value_ms2) ** 2)
    assert times["limit_vdv"] == pytest.approx(300 * (21.0 / found.vdv) ** 4)
    assert set(felt(sine(8.0), position="building").times_s()) == set()
    own = Limits(action_ms2=0.1, limit_ms2=0.2)
    assert felt(sine(8.0), limits=own).times_s()["action_vdv"] is None
    # Directive 2002/44/EC, article 3
    assert LIMITS["hand"] == Limits(action_ms2=2.5, limit_ms2=5.0)
    body = Limits(action_ms2=0.5, limit_ms2=1.15, action_vdv=9.1, limit_vdv=21.0)
    assert LIMITS["seat"] == LIMITS["standing"] == body
    with pytest.raises(GearmonError, match=r"action_ms2 = 2\.0 must lie in \[0, 1\]: not above"):
        Limits(action_ms2=2.0, limit_ms2=1.0)
    with pytest.raises(GearmonError, match=r"action_vdv = 3\.0 must lie in \[0, .*\]: not above"):
        Limits(action_ms2=1.0, limit_ms2=1.0, action_vdv=3.0, limit_vdv=2.0)
    # one value for both is that of a plant that stops where it acts
    assert Limits(action_ms2=1.0, limit_ms2=1.0).action_ms2 == 1.0


def test_the_headline_tells_the_time_to_the_action_value_in_hours():
    found = felt(sine(8.0, 1.0, seconds=300.0))
    told = float(re.search(r"action value of a day after (\S+) h$", found.headline())[1])
    assert told == pytest.approx(found.times_s()["action_ms2"] / 3600, rel=5e-3)


def test_silence_is_no_exposure():
    found = felt(1e-200 * noise(60.0)[0])
    assert found.value_ms2 < 1e-190
    assert found.to_frame()["crest_factor"][0] >= 0
    assert found.times_s()["action_vdv"] is None or found.times_s()["action_vdv"] > 1e6


def test_seat_factor_is_the_gain_of_the_seat():
    floor = noise(60.0, seed=2)
    seat = felt(*(0.7 * floor))
    found = gearmon.seat_factor(seat, felt(*floor))
    assert found.seat_rms == pytest.approx((0.7, 0.7, 0.7))
    assert found.seat_vdv == pytest.approx((0.7, 0.7, 0.7))
    longer = seat_factor(seat, felt(*np.hstack([floor, floor])))
    assert longer.seat_vdv[2] == pytest.approx(0.7, rel=0.02)
    with pytest.raises(GearmonError, match="seat and hand are not weighted alike"):
        seat_factor(seat, felt(*noise(20.0, rate=4000.0), rate=4000.0, position="hand"))
    with pytest.raises(GearmonError, match="the floor does not move"):
        seat_factor(seat, felt(*(floor * 1e-200)))


def clipped():
    return np.clip(noise(20.0), -1.0, 1.0)


REFUSED = {
    "mean of 1": (lambda: felt(noise(20.0)[0] + 1.0), "g were read as m/s2"),
    "mean of 96": (lambda: felt(noise(20.0)[0] + 96.17), "m/s2 were read as g"),
    "gravity along x": (
        lambda: felt(noise(20.0)[0] + 9.81, *noise(20.0)[1:]),
        "axis x has a mean of 9.8. m/s2, which is gravity, but z",
    ),
    "clipped": (lambda: felt(*clipped()), "channel x is clipped: .* record again"),
    "at the range": (lambda: felt(*noise(20.0), range_ms2=4.0), "reaches .* of the sensor's range"),
    "at the range, downwards": (
        lambda: felt(np.where(noise(20.0)[2] > 3.0, 0.0, noise(20.0)[2]), range_ms2=4.0),
        "reaches .* of the sensor's range",
    ),
    "constant": (lambda: felt(np.full(20_000, 2.0)), "is constant"),
    "no unit": (lambda: felt(*noise(20.0), unit=None), "has unit not stated; exposure needs"),
    "mm/s": (lambda: felt(*noise(20.0), unit="mm/s"), "has unit mm/s; exposure needs"),
    "too short": (lambda: felt(*noise(2.0)), "2 s are too short for Wd, which needs 2.5 s"),
    "slow": (lambda: felt(*noise(20.0, rate=100.0), rate=100.0), "100 Hz: Wd counts .* faster"),
    "slow hand": (lambda: felt(*noise(20.0), position="hand"), "Wh counts vibration up to 1000 Hz"),
    "no names": (
        lambda: felt(*noise(20.0), names=("a1", "a2", "a3")),
        "which channel is which axis. a1, a2, a3 do not tell; name them: --axes",
    ),
    "two of one": (
        lambda: felt(*noise(20.0), names=("x", "y", "seat_y")),
        "which channel is which axis",
    ),
    "wrong axis": (lambda: felt(*noise(20.0), axes={"w": 1}), "axes: axis 'w' is not one of x, y"),
    "one twice": (lambda: felt(*noise(20.0), axes={"x": 1, "y": 1}), "one channel for two axes"),
    "no channel": (lambda: felt(*noise(20.0), axes={"x": 7}), "7"),
    "position": (lambda: felt(*noise(20.0), position="chair"), "position='chair' is not one of"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_wrong_is_refused_in_one_line(what):
    call, told = REFUSED[what]
    with pytest.raises(GearmonError, match=told) as stop:
        call()
    assert "\n" not in str(stop.value)
    assert len(str(stop.value)) < 300


def test_what_is_doubtful_is_said():
    told = felt(*noise(60.0, rate=256.0), rate=256.0).warnings
    assert any(own.startswith("sampled at 256 Hz: nothing above 128 Hz is counted") for own in told)
    assert any(own.startswith("60 s are too short for the statistics of VDV") for own in told)
    assert felt(*noise(240.0)).warnings == ()


@pytest.mark.parametrize(("position", "least_s"), [("seat", 227.0), ("building", 108.0)])
def test_statistics_want_the_duration_of_the_standard(position, least_s):
    """ISO 2631-1, 5.5: bands from 0.5 Hz want 227 s, those from 1 Hz 108 s."""
    for seconds in (least_s - 1, least_s + 1):
        told = felt(*noise(seconds, rate=400.0), rate=400.0, position=position).warnings
        assert any("too short for the statistics" in own for own in told) == (seconds < least_s)


@pytest.mark.parametrize("rate", [390.0, 402.0])
def test_a_rate_is_doubted_up_to_twice_the_end_of_the_tolerance(rate):
    """Three third octaves beyond 80 Hz, 10^(2.2) Hz = 158 Hz: ISO 8041-1, table 5."""
    told = felt(*noise(240.0, rate=0.8 * rate), rate=0.8 * rate).warnings
    assert any("nothing above" in own for own in told) == (0.8 * rate < 2 * 10**2.2)


def test_a_file_is_weighed_from_disk_as_from_memory(tmp_path):
    rows = noise(30.0)
    path = tmp_path / "seat.csv"
    recorded(*rows).to_frame().to_csv(path, index=False)
    one, other = gearmon.vibration_exposure(str(path)), felt(*rows)
    assert one.value_ms2 == pytest.approx(other.value_ms2, rel=1e-9)
    assert gearmon.vibration_exposure(path).value_ms2 == one.value_ms2
    g = gearmon.vibration_exposure(
        rows / 9.80665, axes={"x": 1, "y": 2, "z": 3}, sampling_rate_hz=RATE, unit="g"
    )
    assert g.value_ms2 == pytest.approx(other.value_ms2, rel=1e-9)


@pytest.mark.parametrize("frequency_hz", [1.0, 2.5, 8.0, 20.0, 31.5, 63.0])
def test_an_exact_sine_is_not_clipped(frequency_hz):
    sine = np.sqrt(2) * np.sin(2 * np.pi * frequency_hz * np.arange(120_000) / RATE)
    expected = abs(WEIGHTINGS["Wk"].response(frequency_hz))
    assert felt(sine, names=("z",)).axes[0].rms_ms2 == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("seconds", "marker"), [(1.0, "o"), (5.0, "")])
def test_a_single_second_is_drawn_as_a_point(seconds, marker):
    row = sine(20.0, seconds=seconds, rate=2500.0)
    _, course = felt(row, position="hand", rate=2500.0).plot()
    assert course.get_lines()[0].get_marker() == marker
