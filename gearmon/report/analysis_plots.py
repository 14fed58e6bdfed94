"""The pictures of an analysis in the order of a report, and those over time: a history, a day."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby, product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from gearmon.diagnosis.history.changes import LEVEL, ChangePoint
from gearmon.diagnosis.history.trends import SECONDS_PER_DAY, HistoryTrends, ToothTrend
from gearmon.diagnosis.results import Analysis, Change, ToothProfile
from gearmon.errors import counted
from gearmon.report import curves, plots, wording
from gearmon.report.spectrum_plots import amplitude_figure, close_up_figure
from gearmon.report.text import BEYOND, is_beyond, told_teeth
from gearmon.signals.recording import Recording
from gearmon.signals.spectra import fast_length
from gearmon.signatures.measured.line_plan import Family, WheelLines
from gearmon.signatures.measured.reference import WheelPattern

_KINDS = ("mesh", "sidebands", "residual")
# The colour scale of changes spans at least this and at most that [dB].
_LEAST_LIMIT_DB, _MOST_LIMIT_DB = 6.0, 20.0
# Cells narrower than this share of the page cannot hold a number.
_NARROWEST_NUMBERED = 1 / 44
# More channels than this make the picture of a turn unreadable: the strongest are taken.
_MOST_CHANNELS = 4
_MOST_TOOTH_LABELS = 34
_COUNTED = {
    "tacho": "Tooth (tooth 1 at the tachometer pulse)",
    "reference": "Tooth (tooth 1 where the first healthy recording begins)",
    None: "Tooth, from the start of the recording (relative: no tachometer on this shaft)",
}
#: Teeth that get a colour, and others that are drawn behind them in grey.
_MOST_TEETH, _MOST_OTHERS = 4, 200
#: How far beyond the recordings a trend is drawn towards its limit, in lengths of the history.
_AHEAD = 1.0
#: The scale of losses reaches to this at least [%].
_LEAST_SHOWN = 5.0
#: And that of the score to where faults are called.
_LEAST_SCORE = 2.0
_LIMIT: dict[str, Any] = {"color": plots.VERMILLION, "linestyle": (0, (5, 2)), "linewidth": 0.9}


def analysis_figures(
    analysis: Analysis, recording: Recording | None = None
) -> Iterator[plots.Picture]:
    """Draw all pictures that an analysis bears, one at a time, in the order of a report.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    recording : Recording or None
        Its recording; without, the spectra are left out.

    Yields
    ------
    Picture
        With its words.
    """
    signature = analysis.signature
    if recording is not None:
        yield amplitude_figure(analysis, recording)
        for mesh in signature.meshes:
            close_up = close_up_figure(analysis, recording, mesh)
            if close_up is not None:
                yield close_up
    if not signature.found:
        return
    if analysis.changes:
        yield changes_figure(analysis)
    wheels = [wheel for wheel in signature.plan.wheels if len(wheel.number)]
    for row, wheel in enumerate(wheels):
        yield turn_figure(analysis, wheel, at_length=row == 0)
    yield speed_figure(analysis)


def analysis_pictures(
    analysis: Analysis, recording: Recording | None = None
) -> dict[str, plots.Picture]:
    """Return the pictures of `analysis_figures` by their names."""
    return {own.name: own for own in analysis_figures(analysis, recording)}


@plots.style()
def turn_figure(analysis: Analysis, wheel: WheelLines, *, at_length: bool = True) -> plots.Picture:
    """Draw one turn of a gear: its synchronous average by channel, and its energy by tooth.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    wheel : WheelLines
        The gear, of the plan of its signature.
    at_length : bool
        Whether the caption explains everything, as that of the first gear does.

    Returns
    -------
    Picture
    """
    signature = analysis.signature
    pattern = WheelPattern.of(wheel, signature.lines)
    # eight points a cycle of the highest line draw its crests within a tenth
    points = fast_length(8 * (int(wheel.number.max()) + 1))
    average, rest = (curves.turn_waveform(pattern, points, mesh=mesh) for mesh in (True, False))
    power = np.mean(average**2, axis=1)
    channels = sorted(np.argsort(-power, kind="stable")[:_MOST_CHANNELS].tolist())
    profile = curves.profile_of(analysis, wheel.stage, wheel.gear)
    flagged = curves.flagged_place(analysis, wheel.stage, wheel.gear)
    heights = [0.56 if len(channels) > 2 else 0.8] * len(channels)
    figure, axes = plots.stack([*heights, *([0.85] if profile else [])], sharex=True)
    number = curves.tooth_numbers(wheel.teeth * np.arange(points) / points, profile, wheel.teeth)
    order = np.argsort(number, kind="stable")
    for channel, ax in zip(channels, axes, strict=False):
        _mark_flagged(flagged, ax)
        turn, left = average[channel, order], rest[channel, order]
        ax.plot(number[order], turn, color="#a9adb4", linewidth=0.6, label="synchronous average")
        without = "the same without mesh harmonics"
        ax.plot(number[order], left, color=plots.BLUE, linewidth=0.8, label=without)
        plots.light_grid(ax)
        ax.margins(x=0)
        ax.yaxis.set_major_locator(MaxNLocator(4))
        unit = wording.unit_text(signature.units[channel])
        ax.set_ylabel(wording.strip_label(signature.channel_names[channel], unit), fontsize=7)
    if profile is not None:
        _mark_flagged(flagged, axes[-1])
        _plot_teeth(profile, flagged is not None, axes[-1])
    counted_from = None
    if profile is not None and profile.tooth is not None:
        counted_from = profile.counted_from or "tacho"
    most = _MOST_TOOTH_LABELS
    step = next(step for step in (1, 5, 20) if step == 20 or wheel.teeth <= step * most)
    axes[-1].set_xlim(0.5, wheel.teeth + 0.5)
    axes[-1].set_xticks(sorted({1, *range(step, wheel.teeth + 1, step)}))
    axes[-1].set_xlabel(_COUNTED.get(counted_from, _COUNTED[None]))
    plots.legend(figure, axes[:1])
    return figure.told(
        f"turn-{wheel.stage}-{wheel.gear}",
        wheel=wheel,
        profile=profile,
        place=None if profile is None else round(curves.peak_place(profile)),
        flagged=flagged is not None,
        at_length=at_length,
        channels=len(signature.channel_names),
        most=_MOST_CHANNELS,
    )


def _plot_teeth(profile: ToothProfile, flagged: bool, ax: Axes) -> None:
    """Draw the energy of the deviation by tooth as bars; name the flagged tooth, or the highest."""
    teeth, top = profile.teeth, float(profile.energy.max())
    number = curves.tooth_numbers(np.arange(float(teeth)), profile, teeth)
    peak = int(np.argmax(profile.energy))
    place, ratio = number[peak], top
    colours = [plots.SKY] * teeth
    if flagged:  # found by its form, which may be clearest beside the highest bar
        place, ratio = curves.peak_place(profile), profile.ratio
        peak = int(np.argmin(np.abs(number - place)))
        colours[peak] = plots.VERMILLION
    ax.bar(number, profile.energy, width=0.8, color=colours, edgecolor=plots.BLACK, linewidth=0.3)
    ax.axhline(1.0, color=plots.BLACK, linewidth=0.7, linestyle=plots.DASHED)
    name = "" if profile.tooth is None else f"tooth {(round(place) - 1) % teeth + 1}: "
    left = place > 0.6 * teeth
    state = "flagged" if flagged else "highest, not flagged"
    how: dict[str, Any] = {"xytext": (-6 if left else 6, 2), "textcoords": "offset points"}
    how |= {"ha": "right" if left else "left", "va": "bottom", "fontsize": 7}
    how |= {"fontweight": "bold" if flagged else "normal"}
    # above the bars beside it, which may be higher
    ax.annotate(f"{name}{ratio:.1f} × elsewhere ({state})", (number[peak], top), **how)
    ax.set_ylim(0, 1.25 * max(top, 1.6))
    plots.light_grid(ax)
    ax.set_ylabel("Energy by tooth\n(elsewhere 1)", fontsize=7)


def _mark_flagged(place: float | None, ax: Axes) -> None:
    if place is not None:
        ax.axvspan(place - 1.0, place + 1.0, color=plots.VERMILLION, alpha=0.15, linewidth=0)


@plots.style()
def speed_figure(analysis: Analysis) -> plots.Picture:
    """Draw the speed of shaft 1 over time.

    Parameters
    ----------
    analysis : Analysis
        The analysis.

    Returns
    -------
    Picture
    """
    track, speed = analysis.signature.track, analysis.signature.speed
    time_s, speed_hz = 0.5 * (track.time_s[:-1] + track.time_s[1:]), track.speed_hz
    if len(time_s) == 1:
        time_s, speed_hz = track.time_s, np.repeat(speed_hz, 2)
    figure, (ax,) = plots.stack([1.4])
    nominal, mean = speed.nominal_hz, speed.estimated_hz
    dashed: dict[str, Any] = {"color": plots.GREY, "linewidth": 0.9, "linestyle": plots.DASHED}
    ax.axhline(nominal, label=f"nominal {nominal:.5g} Hz", **dashed)
    ax.axhline(mean, color=plots.BLACK, linewidth=0.7, label=f"mean {mean:.6g} Hz")
    if np.isfinite(speed.uncertainty_hz):
        low, high = mean - speed.uncertainty_hz, mean + speed.uncertainty_hz
        ax.axhspan(low, high, color=plots.LIGHT_GREY, linewidth=0)
    ax.plot(time_s, speed_hz, color=plots.BLUE, linewidth=1.0, label=f"speed, by {speed.method}")
    lowest, highest = float(speed_hz.min()), float(speed_hz.max())
    # a steady speed must not be blown up until its last digit looks like trouble
    room = max(0.15 * (highest - lowest), 0.002 * mean)
    ax.set_ylim(min(lowest, nominal) - room, max(highest, nominal) + room)
    ax.set(xlim=(float(time_s[0]), float(time_s[-1])), xlabel="Time (s)", ylabel="Shaft 1 (Hz)")
    ax.ticklabel_format(useOffset=False)
    to_rpm, to_hz = partial(np.multiply, 60.0), partial(np.multiply, 1 / 60.0)
    right = ax.secondary_yaxis("right", functions=(to_rpm, to_hz))
    right.set_ylabel("Shaft 1 (rpm)")
    plots.light_grid(ax)
    plots.legend(figure, [ax])
    return figure.told("speed", speed=speed)


#: Stage, label, and families that differ only in the mesh harmonic, ascending.
FamilyGroup = tuple[int, str, list[Family]]


def family_groups(families: Sequence[Family]) -> list[FamilyGroup]:
    """Return the families by stage, kind and what repeats, as rows of a picture."""

    def repeats(own: Family) -> tuple[Any, ...]:
        return own.stage, _KINDS.index(own.kind), -own.spacing, own.gear

    ordered = sorted(families, key=lambda own: (*repeats(own), own.harmonic))
    groups = [list(own) for _, own in groupby(ordered, repeats)]
    result: list[FamilyGroup] = []
    for stage, same in groupby(groups, lambda own: own[0].stage):
        of_stage = list(same)
        # two spacings of one gear in one stage are told apart by their order
        spacings = [own[0].spacing for own in of_stage]
        names = wording.told_apart([_label(own[0]) for own in of_stage], spacings)
        result += [(stage, name, own) for name, own in zip(names, of_stage, strict=True)]
    return result


def _label(family: Family) -> str:
    if family.kind == "mesh":
        return f"mesh {family.stage}"
    return f"{family.kind}, {wording.shaft_text(family.shaft, family.gear)}"


@plots.style()
def changes_figure(analysis: Analysis) -> plots.Picture:
    """Draw the changes of every stage: groups of families by channels and mesh harmonics.

    Parameters
    ----------
    analysis : Analysis
        With changes.

    Returns
    -------
    Picture
    """
    sizes = [abs(change.change_db) for change in analysis.changes]
    limit = float(np.clip(np.percentile(sizes, 98), _LEAST_LIMIT_DB, _MOST_LIMIT_DB))
    groups = family_groups(analysis.signature.plan.families)
    stages = sorted({change.stage for change in analysis.changes})
    own = [[group for group in groups if group[0] == stage] for stage in stages]
    heights = [0.62 + 0.24 * len(rows) for rows in own]
    figure, axes = plots.stack(heights, room_in=0.1)
    for stage, rows, ax in zip(stages, own, axes, strict=True):
        image = _plot_changes(analysis, rows, limit, ax)
        ax.set_xlabel(f"Harmonic of mesh {stage}")
    figure.colorbar(image, ax=axes, extend="both", shrink=0.7, pad=0.02, label="Change (dB)")
    strongest = max(analysis.changes, key=lambda change: abs(change.standardised))
    return figure.told("changes", beyond=BEYOND, strongest=strongest)


def _plot_changes(
    analysis: Analysis, rows: Sequence[FamilyGroup], limit_db: float, ax: Axes
) -> AxesImage:
    """Draw the changes of one stage as coloured cells, with numbers where they fit."""
    channels = analysis.signature.channel_names
    harmonics = sorted({family.harmonic for _, _, own in rows for family in own})
    columns = len(channels) * len(harmonics)
    numbered = 0.8 / columns > _NARROWEST_NUMBERED
    changes = {(change.family, change.channel): change for change in analysis.changes}
    table = np.full((len(rows), columns), np.nan)
    for row, (_, _, families) in enumerate(rows):
        for family, (block, channel) in product(families, enumerate(channels)):
            change = changes.get((family.name, channel))
            if change is not None:
                column = block * len(harmonics) + harmonics.index(family.harmonic)
                table[row, column] = change.change_db
                dark = abs(change.change_db / limit_db) > 0.62
                _write_change(ax, column, row, change, "white" if dark else plots.BLACK, numbered)
    image = plots.heat_map(ax, table, "RdBu_r", "#f1f1f1", vmin=-limit_db, vmax=limit_db)
    for edge in range(1, len(channels)):
        ax.axvline(edge * len(harmonics) - 0.5, color="white", linewidth=3)
    ax.set_yticks(range(len(rows)), [label for _, label, _ in rows])
    every = next((step for step in (1, 2, 5, 10, 20) if columns <= 48 * step), 50)
    ticks = [c for c in range(columns) if c % len(harmonics) % every == 0]
    ax.set_xticks(ticks, [str(harmonics[c % len(harmonics)]) for c in ticks], fontsize=6)
    ax.tick_params(length=0, pad=2)
    ax.spines[:].set_visible(False)
    for block, channel in enumerate(channels):
        middle = (block + 0.5) * len(harmonics) - 0.5
        plots.above(ax, middle, wording.shortened(channel), fontweight="bold", fontsize=7.5)
    return image


def _write_change(
    ax: Axes, column: int, row: int, change: Change, colour: str, numbered: bool
) -> None:
    """Write a change into its cell, where there is room, and frame what is beyond chance."""
    beyond, decibels = is_beyond(change), change.change_db
    if numbered:
        number = "0" if abs(decibels) < 0.5 else f"{decibels:+.0f}".replace("-", "−")
        how: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6, "color": colour}
        ax.text(column, row, number, weight="bold" if beyond else "normal", **how)
    elif beyond:
        ax.plot(column, row, marker="o", markersize=1.8, color=colour)
    if beyond:
        how = {"fill": False, "edgecolor": plots.BLACK, "linewidth": 0.9}
        ax.add_patch(Rectangle((column - 0.44, row - 0.44), 0.88, 0.88, **how))


@plots.style()
def kind_figure(changes: Mapping[str, pd.DataFrame]) -> plots.Picture:
    """Draw the changes of several states: one panel a state, bars of changes.

    Parameters
    ----------
    changes : mapping of str to DataFrame
        By the title of the panel: changes [dB], a row a recording, a column a feature; the same
        features and recordings in all.
    """
    figure, axes = plots.stack([1.2] * len(changes), room_in=0.5)
    low = min(0.0, *(float(frame.to_numpy().min()) for frame in changes.values()))
    high = max(float(frame.to_numpy().max()) for frame in changes.values())
    for (title, frame), ax in zip(changes.items(), axes, strict=True):
        place, width = np.arange(len(frame.columns), dtype=float), 0.8 / len(frame)
        for number, (name, row) in enumerate(frame.iterrows()):
            shift = (number - 0.5 * (len(frame) - 1)) * width
            ax.bar(
                place + shift, row, 0.92 * width, color=plots.series_colour(number), label=str(name)
            )
        ax.axhline(0.0, color=plots.BLACK, linewidth=0.6)
        ax.set_title(title, pad=3)
        ax.set_xticks(place, frame.columns if ax is axes[-1] else [""] * len(place))
        ax.set_ylim(1.08 * low - 0.5, 1.08 * high + 0.5)
        plots.light_grid(ax)
    figure.supylabel("Change, or height above\nthe median (dB)", fontsize=7.5)
    plots.legend(figure, axes[:1], columns=6)
    return figure


@plots.style()
def history_figure(
    found: HistoryTrends, known_loss: Sequence[float] | None = None
) -> plots.Picture:
    """Draw losses over time, if any were estimated or are known, and the scores.

    Parameters
    ----------
    found : HistoryTrends
        With at least one recording.
    known_loss : sequence of float, optional
        The share that is known to have been lost in each recording, where it is simulated.

    Returns
    -------
    Picture
    """
    entries, losses = found.history.entries, bool(found.teeth) or known_loss is not None
    heights = [2.3, 1.15] if losses else [1.8]
    room = 1.2 if found.shown else 0.9 if losses else 0.8
    figure, axes = plots.stack(heights, room_in=room, sharex=True)
    times = _days([entry.time_s for entry in entries])
    if losses:
        _losses(found, axes[0])
    if known_loss is not None:
        how: dict[str, Any] = {"color": plots.BLACK, "linestyle": (0, (1, 1.5)), "linewidth": 0.9}
        axes[0].plot(times, 100 * np.asarray(known_loss, dtype=float), label="known loss", **how)
    score, verdicts = axes[-1], [entry.verdict for entry in entries]
    plots.plot_verdicts(times, [entry.score for entry in entries], verdicts, score, 4)
    shade = {"color": plots.GREY, "alpha": 0.2}
    _mark_changes(found.evidence.changes, "evidence changed (interval shaded)", shade, score)
    low, high = score.get_ylim()
    score.set(ylim=(min(0.0, low), max(high, _LEAST_SCORE)), xlabel="Time (UTC)")
    score.set_ylabel("Score (−log₁₀ p)")
    plots.light_grid(score)
    locator = AutoDateLocator()  # type: ignore[no-untyped-call]
    score.xaxis.set_major_locator(locator)
    score.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    plots.legend(figure, axes, columns=3)
    return figure


def _days(time_s: Any) -> Any:
    return np.asarray(time_s, dtype=float) / SECONDS_PER_DAY


def _losses(found: HistoryTrends, ax: Axes) -> None:
    shown, newest = told_teeth(found)[:_MOST_TEETH], found.history.entries[-1]
    # what the newest recording calls lost, however few recordings do
    new = [
        own
        for own in sorted(found.teeth, key=lambda own: -own.low[-1])
        if newest.verdict == "fault"
        and own.trend.series.time_s[-1] == newest.time_s
        and own.low[-1] > 0
        and own not in shown
    ]
    drawn = [*shown, *new][:_MOST_TEETH]
    others = [tooth for tooth in found.teeth if tooth not in drawn]
    other = "other " if drawn else ""
    name = counted(len(others), f"{other}tooth", f"{other}teeth")
    # a line above the limit need not be a loss
    told = name if any(tooth.stands for tooth in others) else f"{name}, no loss clear of noise"
    for number, tooth in enumerate(others[:_MOST_OTHERS]):
        label = "_" if number else told
        how: dict[str, Any] = {"color": plots.GREY, "linewidth": 0.5, "zorder": 1, "label": label}
        ax.plot(_days(tooth.trend.series.time_s), 100 * tooth.trend.series.value, **how)
    for number, tooth in enumerate(drawn):
        _estimates(tooth, number, "" if tooth in shown else ", not yet over several recordings", ax)
        if tooth in shown:
            _trend(tooth, plots.series_colour(number), ax)
    if found.limit is not None:
        ax.axhline(100 * found.limit, label="limit", **_LIMIT)
    # what sound teeth seem to lose is next to nothing, and is not to fill the picture
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -0.1 * _LEAST_SHOWN), max(high, _LEAST_SHOWN))
    ax.set_ylabel("Loss of pair stiffness (%)")
    plots.light_grid(ax)


def _estimates(tooth: ToothTrend, number: int, more: str, ax: Axes) -> None:
    series, colour = tooth.trend.series, plots.series_colour(number)
    # the recordings' own 90 % intervals
    reach = np.maximum([series.value - tooth.low, tooth.high - series.value], 0.0)
    name = wording.gear_text(tooth.stage, tooth.gear, tooth.tooth)
    how: dict[str, Any] = {"fmt": plots.series_marker(number), "markersize": 3.2}
    how |= {"color": colour, "elinewidth": 0.6, "label": name + more}
    ax.errorbar(_days(series.time_s), 100 * series.value, yerr=100 * reach, **how)


def _trend(tooth: ToothTrend, colour: str, ax: Axes) -> None:
    """Draw the trend, dotted from the last recording to the limit, and when it changed."""
    start, now = tooth.trend.series.time_s[[0, -1]].tolist()
    last, crossing, end = now + _AHEAD * (now - start), tooth.crossing, now
    if crossing is not None and crossing.time_s is not None and tooth.limit is not None:
        end = max(now, min(crossing.time_s, last))
        late = last if crossing.high_s is None else crossing.high_s
        early = crossing.time_s if crossing.low_s is None else crossing.low_s
        bar: dict[str, Any] = {"linewidth": 2.6, "solid_capstyle": "butt", "color": colour}
        reached = _days(np.minimum([early, late], last))
        ax.plot(reached, [100 * tooth.limit] * 2, label="when the limit is reached", **bar)
    if end == start:
        return
    times = np.union1d(np.linspace(start, end, 300), [c.time_s for c in tooth.trend.changes])
    value, low, high = tooth.trend.at(times)
    behind = times <= now
    ax.plot(_days(times[behind]), 100 * value[behind], color=colour, linewidth=1.0)
    ax.plot(_days(times[~behind]), 100 * value[~behind], color=colour, linewidth=0.9, linestyle=":")
    if np.isfinite(low).all() and np.isfinite(high).all():
        foot = np.maximum(low, np.minimum(value, 0.0))
        shade: dict[str, Any] = {"color": colour, "alpha": 0.16, "linewidth": 0, "zorder": 0}
        shade["label"] = f"trend, {100 * LEVEL:.3g} % interval"
        ax.fill_between(_days(times), 100 * foot, 100 * high, **shade)
    # the interval of the time stands at the foot: full height would hide what is drawn there
    interval = {"color": colour, "alpha": 0.35, "ymax": 0.04}
    _mark_changes(tooth.trend.changes, "loss changed (interval at the foot)", interval, ax)


def _mark_changes(
    changes: Sequence[ChangePoint], label: str, interval: dict[str, Any], ax: Axes
) -> None:
    """Draw when something changed, and the interval of that time."""
    for number, change in enumerate(changes):
        ax.axvspan(_days(change.low_s), _days(change.high_s), lw=0, **interval)
        line: dict[str, Any] = {"color": interval["color"], "linewidth": 0.85, "linestyle": "--"}
        ax.axvline(_days(change.time_s), label="_" if number else label, **line)


@plots.style()
def day_figure(day: pd.DataFrame, limit_db: float) -> plots.Picture:
    """Draw a day: load, speed, level of the vibration, and what was concluded.

    Parameters
    ----------
    day : DataFrame
        A row a recording, by hour of the day: `load` as a share of the nominal torque, `speed_hz`
        of shaft 1, `score`, `verdict`, and one or more columns "level of ..." less the mean level
        of the reference [dB].
    limit_db : float
        A limit on the levels [dB].
    """
    figure, axes = plots.stack([0.8, 0.8, 1.2, 1.2], room_in=0.8, sharex=True)
    load, speed, level, score = axes
    load.plot(day.index, 100 * day["load"], color=plots.BLACK, marker="o", markersize=2.5)
    load.set_ylabel("Load\n(% of nominal)")
    speed.plot(day.index, day["speed_hz"], color=plots.BLACK, marker="o", markersize=2.5)
    speed.set_ylabel("Speed of\nshaft 1 (Hz)")
    for number, (name, moved) in enumerate(day.filter(like="level of ").items()):
        marker, colour = plots.series_marker(number), plots.series_colour(number)
        level.plot(day.index, moved, color=colour, marker=marker, markersize=3, label=str(name))
    level.axhline(limit_db, label="level limit", **_LIMIT)
    level.set_ylabel("Level re mean of\nreference (dB)")
    scores = day["score"].tolist()
    plots.plot_verdicts(day.index.tolist(), scores, day["verdict"].tolist(), score, 4.5)
    lowest, highest = min(scores), max(scores)
    score.set(ylim=(min(-0.1, 1.1 * lowest), max(2.5, 1.1 * highest)), ylabel="Score")
    for ax in axes:
        plots.light_grid(ax)
    score.set_xlabel("Hour of the day (UTC)")
    plots.legend(figure, axes, columns=6)
    return figure
