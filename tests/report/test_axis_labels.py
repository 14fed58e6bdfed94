"""Every picture says what it shows and in which unit, and its curves are in that unit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from reference.drawn_extent import badly_filled
from reference.small_gearbox import machine, recording

from gearmon import report
from gearmon.dynamics.stability import FourierShape, stability_map
from gearmon.errors import ArgumentError
from gearmon.gears.stiffness_report import compare_forms, stiffness_report
from gearmon.machine import load_machine
from gearmon.report.analysis_plots import analysis_figures, day_figure, kind_figure
from gearmon.report.expected_plots import (
    family_figure,
    form_figure,
    signature_figure,
    stability_figure,
    stiffness_figures,
)
from gearmon.report.plots import as_png
from gearmon.report.recording_plots import (
    average_figures,
    indicator_figure,
    order_map_figure,
)
from gearmon.report.spectrum_plots import order_figure, spectrum_figure
from gearmon.signatures.expected.baseline import expected_signature
from gearmon.signatures.expected.fault_family import fault_family
from gearmon.signatures.gear_averages import gear_averages
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.signatures.recording_spectrum import order_spectra, recording_spectrum

SIGNATURES = Path(__file__).parents[2] / "signatures"


def labels(figure):
    """What stands along the axes of a figure, scales of colours and second axes included."""
    assert badly_filled(figure) == []
    # names of machines, channels and files reach every text: none may be parsed as a formula
    texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text()]
    assert not any(text.get_parse_math() for text in texts)
    axes = [*figure.axes, *(child for ax in figure.axes for child in ax.child_axes)]
    said = {label for ax in axes for label in (ax.get_xlabel(), ax.get_ylabel())}
    # one label for all strips stands upright at the left edge
    said |= {text.get_text() for text in figure.texts if text.get_rotation() == 90}
    return said - {""}


def legends(figure):
    """What the legends of a figure name, each that is not alone on its axes in its order."""
    own = [*figure.legends, *(found for ax in figure.axes if (found := ax.get_legend()))]
    return [[text.get_text() for text in one.get_texts()] for one in own]


STRIPS = {"front\n(m/s²)", "rear\nunit not\nstated"}
OF_AN_ANALYSIS = {
    "spectrum": {"Frequency (Hz)", "Peak amplitude", *STRIPS},
    "sidebands-mesh-1": {"Frequency at the mean speed (Hz)", "Peak amplitude", *STRIPS},
    "changes": {"Harmonic of mesh 1", "Change (dB)"},
    "turn-1-pinion": {
        "Tooth (tooth 1 at the tachometer pulse)",
        "Energy by tooth\n(elsewhere 1)",
        *STRIPS,
    },
    "turn-1-gear": {
        "Tooth, from the start of the recording (relative: no tachometer on this shaft)",
        "Energy by tooth\n(elsewhere 1)",
        *STRIPS,
    },
    "speed": {"Time (s)", "Shaft 1 (Hz)", "Shaft 1 (rpm)"},
}


def test_pictures_of_an_analysis(faulty, gearless):
    drawn = list(analysis_figures(faulty.analysis, faulty.recording))
    found = {figure.name: labels(figure) for figure in drawn}
    turn = [["synchronous average", "the same without mesh harmonics"]]
    speed = faulty.analysis.signature.speed
    assert {figure.name: own for figure in drawn if (own := legends(figure))} == {
        "sidebands-mesh-1": [["sidebands of shaft 2", "sidebands of shaft 1"]],
        "turn-1-pinion": turn,
        "turn-1-gear": turn,
        "speed": [["nominal 20 Hz", f"mean {speed.estimated_hz:.6g} Hz", "speed, by tacho"]],
    }
    # the wheel does not carry the pulse: its teeth count from the first healthy recording
    gear = found["turn-1-gear"]
    assert any(label.startswith("Tooth") for label in gear)
    found["turn-1-gear"] = {
        label
        if not label.startswith("Tooth")
        else "Tooth, from the start of the recording (relative: no tachometer on this shaft)"
        for label in gear
    }
    assert found == OF_AN_ANALYSIS
    searched = list(analysis_figures(gearless.analysis, gearless.recording))[1]
    assert labels(searched) == {"Frequency (Hz)", "Peak amplitude", *STRIPS}


def test_the_speed_is_the_same_in_both_units(healthy):
    *_, figure = analysis_figures(healthy.analysis, None)
    as_png(figure)
    (ax,) = figure.axes
    (rpm,) = ax.child_axes
    assert rpm.get_ylim() == pytest.approx([60 * hz for hz in ax.get_ylim()])


@pytest.mark.parametrize(
    ("kind", "axis", "value", "unit"),
    [
        ("amplitude", "Frequency (Hz)", "Peak amplitude", "m/s²"),
        ("rms", "Frequency (Hz)", "RMS of the line", "m/s²"),
        ("density", "Frequency (Hz)", "Power spectral density", "(m/s²)²/Hz"),
        ("energy", "Frequency (Hz)", "Energy per line", "(m/s²)²"),
        ("envelope", "Frequency (Hz)", "Envelope of 1000 to 4000 Hz", "m/s²"),
    ],
)
def test_spectra(kind, axis, value, unit):
    band = (1000.0, 4000.0) if kind == "envelope" else None
    found = recording_spectrum(recording(), kind, band=band)
    strips = {f"{name}\n({unit})" if unit else name for name in found.channel_names}
    assert labels(spectrum_figure(found)) == {axis, value, *strips}


@pytest.mark.parametrize(
    ("kind", "axis", "label"),
    [
        ("cepstrum", "quefrency_s", "Quefrency (s)"),
    ],
)
def test_spectra_without_a_unit(kind, axis, label):
    found = recording_spectrum(recording())
    units = ("1",) * len(found.units)
    found = replace(found, kind=kind, axis=axis, value_name="of no unit", units=units)
    figure = spectrum_figure(found)
    assert labels(figure) == {label, "Of no unit", *found.channel_names}
    assert {ax.get_yscale() for ax in figure.axes} == {"linear"}


def test_kurtogram():
    found = recording_spectrum(recording(), "kurtogram")
    figure = spectrum_figure(found)
    assert labels(figure) == {"Frequency (Hz)", "Bandwidth (Hz)", "Kurtosis"}
    ax = figure.axes[0]
    assert ax.get_xlim() == (0.0, recording().sampling_rate_hz / 2)
    # the first row is the whole band
    assert ax.get_yticklabels()[0].get_text() == f"{recording().sampling_rate_hz / 2:.0f}"
    # the frame is a band of its own row
    own = found.kurtograms[0]
    low, high, top = own.best
    (frame,) = (own for own in ax.patches if own.get_height() == 1)
    assert (frame.get_x(), frame.get_width()) == (low, high - low)
    bands, level = own.bands[int(frame.get_y())], own.kurtosis[int(frame.get_y())]
    assert frame.get_width() == pytest.approx(own.rate / 2 / bands)
    assert level[round(low / frame.get_width())] == top


def test_orders_maps_averages_and_indicators():
    along = order_spectra(recording(), machine(), map_against="time")
    names = along.channel_names
    strips = {f"{name}\n(m/s²)" for name in names}
    order = "Order (cycles a turn of shaft 1)"
    assert labels(order_figure(along)) == {order, "Peak amplitude", *strips}
    scales = {f"{name}\npeak amplitude (m/s²)" for name in names}
    assert labels(order_map_figure(along)) == {order, "Time (s)", "Shaft 1 (Hz)", *scales}
    over = order_spectra(recording(), machine(), map_against="speed")
    assert labels(order_map_figure(over)) == {order, "Speed of shaft 1 (Hz)", *scales}
    figures = average_figures(gear_averages(recording(), machine()))
    assert list(figures) == ["-1-pinion", "-1-gear"]
    for gear, figure in zip(("pinion", "gear"), figures.values(), strict=True):
        (turn,) = labels(figure) - {"Acceleration", *strips}
        assert legends(figure) == [
            ["synchronous average", "± 2 standard errors", "residual", "difference"]
        ]
        assert turn.startswith(f"Angle of the {gear} (tooth pitches; 0 ")
    table = indicator_table(recording(), machine())
    drawn = indicator_figure([table]).axes
    for ax in drawn:
        values = np.concatenate([np.atleast_1d(line.get_ydata()) for line in ax.lines])
        low, high = ax.get_ylim()
        assert low <= values.min() <= values.max() <= high
        assert low <= 0.0
    panels = [ax.get_title(loc="left") for ax in drawn]
    units = {(row.indicator, row.input.split(",")[0]): row.unit for row in table.rows}
    said = {"1": "", "m/s2": " (m/s²)"}
    assert panels == [f"{name}{said[unit]}\nof {of}" for (name, of), unit in units.items()]
    assert any("(m/s²)" in panel for panel in panels)


def test_stiffness_forms_and_stability():
    pair = load_machine(SIGNATURES / "reference_pair.toml")
    (sheet,) = stiffness_figures(stiffness_report(pair, ["crack:1:pinion:5:20%"])).values()
    assert labels(sheet) == {
        "across the line of centres in mm",
        "along the line of centres in mm",
        "along the face in mm",
        "above root in mm",
        "mesh phase in mesh periods",
        "mesh stiffness in GN/m",
        "phase of the pair's contact in mesh periods",
        "share of pair compliance in %",
        "depth of the root crack (pinion) in mm",
        "loss of pair stiffness in %",
    }
    assert legends(sheet) == [
        ["pinion", "gear", "crack", "contact"],
        ["damaged", "healthy"],
        ["bending", "shear", "axial", "foundation", "contact"],
        ["greatest in the contact", "mean over the contact", "1.91 mm"],
    ]
    assert sheet.get_suptitle() == "stage 1, pinion-gear: crack:1:pinion:5:20%"
    forms = compare_forms(pair)
    figure = form_figure(forms)
    assert legends(figure) == [
        ["parabola (reference)"],
        ["reference", "half-sine arches"],
        ["reference", "rectangle, true duty", "rectangle, duty 1/2"],
        ["reference", "Fourier sum, true duty", "Fourier sum, duty 1/2"],
    ]
    assert labels(figure) == {
        "mesh phase in mesh periods",
        "stiffness in GN/m",
        "amplitude in MN/m",
        f"mesh harmonic (times {forms.spectrum[0]['frequency_hz']:.5g} Hz)",
    }
    chart = stability_map(FourierShape(np.array([0.5])), 0.02, (1.5, 2.5), 0.5, points=(12, 6))
    figure = stability_figure(chart)
    expanded = [f"multiple scales, {order} order" for order in ("1st", "2nd")]
    assert legends(figure) == [["2/n", "boundary, exact", *expanded]]
    assert labels(figure) == {
        "mesh frequency over natural frequency, ω/ω₀",
        "stiffness variation ε",
        "growth: ln of the largest multiplier, per mesh period",
    }


def test_signature():
    fault = "crack:1:pinion:5:20%"
    found = expected_signature(SIGNATURES / "reference_pair.toml", [fault], max_hz=2000.0)
    figure = signature_figure(found)
    assert labels(figure) == {"acceleration\nin m/s² (peak)", "frequency in Hz"}
    assert figure.texts[0].get_text() == f"{found.machine}: {fault}"
    mesh, beside = figure.axes[0].collections
    assert (mesh.get_label(), beside.get_label()) == ("mesh lines", "sidebands of the pinion")
    for lines, own in ((mesh, found["sideband"] == 0), (beside, found["sideband"] != 0)):
        tops = np.array([segment[1] for segment in lines.get_segments()])
        drawn = own & (found["acceleration_ms2"] > 1e-5 * found["acceleration_ms2"].max())
        assert tops[:, 0] == pytest.approx(found["frequency_hz"][drawn])
        assert tops[:, 1] == pytest.approx(found["acceleration_ms2"][drawn])
    # harmonics are named where they stand
    (above,) = figure.axes[0].child_axes
    figure.canvas.draw()
    ends = np.array(figure.axes[0].get_xlim()) / found.header["mesh_frequency_hz"]
    assert above.get_xlim() == pytest.approx(ends)
    assert all(float(own).is_integer() for own in above.get_xticks())
    silent = replace(found, columns=dict(found.columns) | {"acceleration_ms2": 0 * found["order"]})
    with pytest.raises(ArgumentError, match="no line above 0 to draw"):
        silent.plot()


def test_fault_family():
    family = fault_family(
        load_machine(SIGNATURES / "reference_pair.toml"),
        kinds=["crack", "eccentricity"],
        sizes=["5%", "20%", "20um", "40um"],
        gears=["pinion"],
    )
    figure = family_figure(family)
    crack, eccentricity = (ax for ax in figure.axes if ax.get_visible())
    assert crack.get_ylabel() == "dB re healthy mesh lines"
    assert crack.get_xlabel() == "loss of pair stiffness in %"
    assert eccentricity.get_xlabel() == "size in µm"
    assert "rms acceleration of the sidebands" in figure.get_suptitle()
    x, y = crack.lines[0].get_data()
    assert x == pytest.approx([5.0, 20.0], rel=0.05)
    assert eccentricity.lines[0].get_xdata() == pytest.approx([20.0, 40.0])
    rows = [row for row in family.rows() if row["kind"] == "crack"]
    ratio = [row["sidebands_ms2"] / row["healthy_ms2"] for row in rows]
    assert y == pytest.approx(20 * np.log10(ratio))


def test_a_picture_of_a_family_names_the_operating_point_that_it_shows():
    pair = load_machine(SIGNATURES / "reference_pair.toml")
    points = tuple(
        replace(pair.operating[0], torque_nm=torque, share=0.5, name=name)
        for name, torque in (("light", 20.0), ("heavy", 98.0))
    )
    family = fault_family(
        replace(pair, operating=points), kinds=["eccentricity"], sizes=["20um"], gears=["pinion"]
    )
    for number, point in enumerate(points):
        figure = family_figure(family, number)
        assert f"{pair.name}, {point.name}: " in figure.get_suptitle()
        (row,) = (row for row in family.rows() if row["operating"] == number)
        level = 20 * np.log10(row["sidebands_ms2"] / row["healthy_ms2"])
        assert figure.axes[0].lines[0].get_ydata() == pytest.approx([level])


def test_demos():
    hour = np.arange(3.0)
    known = {"load": 0.5 + hour, "speed_hz": 20 + hour, "level of a1": hour - 1, "score": hour}
    day = pd.DataFrame(known | {"verdict": ["healthy"] * 3}, index=hour)
    figure = day_figure(day, 3.0)
    assert legends(figure) == [["level of a1", "level limit", "healthy"]]
    assert labels(figure) == {
        "Load\n(% of nominal)",
        "Speed of\nshaft 1 (Hz)",
        "Level re mean of\nreference (dB)",
        "Score",
        "Hour of the day (UTC)",
    }
    kinds = {"t": pd.DataFrame({"a": [1.0]}, index=["b"])}
    assert labels(kind_figure(kinds)) == {"Change, or height above\nthe median (dB)"}


def test_nothing_is_a_formula_when_it_is_drawn(faulty):
    drawn = [
        *analysis_figures(faulty.analysis, faulty.recording),
        order_map_figure(order_spectra(recording(), machine())),
    ]
    for figure in drawn:
        as_png(figure)
        # asking makes marks of the axes that were never drawn: they say nothing
        said = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text()]
        assert said
        for text in said:
            assert not text.get_parse_math()
            assert "$" not in text.get_text()


def test_the_front_door_offers_what_it_names():
    for name in report.__all__:
        assert callable(getattr(report, name)), name
    with pytest.raises(AttributeError, match="no attribute 'pictures'"):
        report.pictures  # noqa: B018
