"""Pictures over time: the losses and scores of a history, and a day of changing load and speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

from gearmon.diagnosis.history.changes import LEVEL, ChangePoint
from gearmon.diagnosis.history.trends import SECONDS_PER_DAY, HistoryTrends, ToothTrend
from gearmon.report import plots
from gearmon.report.text import told_teeth
from gearmon.report.wording import counted, gear_text

#: Teeth that get a colour, and others that are drawn behind them in grey.
_MOST_TEETH, _MOST_OTHERS = 4, 200
#: How far beyond the recordings a trend is drawn towards its limit, in lengths of the history.
_AHEAD = 1.0
#: The scale of losses reaches to this at least [%].
_LEAST_SHOWN = 5.0
#: And that of the score to where faults are called.
_LEAST_SCORE = 2.0
_LIMIT: dict[str, Any] = {"color": plots.VERMILLION, "linestyle": (0, (5, 2)), "linewidth": 0.9}


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
    losses = bool(found.teeth) or known_loss is not None
    heights = [2.3, 1.15] if losses else [1.8]
    room = 1.2 if found.shown else 0.9 if losses else 0.8
    figure, axes = plots.stack(heights, room_in=room, sharex=True)
    if losses:
        _losses(found, axes[0])
    if known_loss is not None:
        how: dict[str, Any] = {"color": plots.BLACK, "linestyle": (0, (1, 1.5)), "linewidth": 0.9}
        times = _days([entry.time_s for entry in found.history.entries])
        axes[0].plot(times, 100 * np.asarray(known_loss, dtype=float), label="known loss", **how)
    _scores(found, axes[-1])
    locator = AutoDateLocator()  # type: ignore[no-untyped-call]
    axes[-1].xaxis.set_major_locator(locator)
    axes[-1].xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    axes[-1].set_xlabel("Time (UTC)")
    plots.legend(figure, axes, columns=3)
    return figure


def _days(time_s: Any) -> Any:
    return np.asarray(time_s, dtype=float) / SECONDS_PER_DAY


def _losses(found: HistoryTrends, ax: Axes) -> None:
    shown = told_teeth(found)[:_MOST_TEETH]
    new = [tooth for tooth in _newly_lost(found) if tooth not in shown]
    drawn = [*shown, *new][:_MOST_TEETH]
    others = [tooth for tooth in found.teeth if tooth not in drawn]
    for number, tooth in enumerate(others[:_MOST_OTHERS]):
        label = "_" if number else _others_label(others, bool(drawn))
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


def _others_label(others: Sequence[ToothTrend], beside_shown: bool) -> str:
    """Say what the grey lines are: a line above the limit need not be a loss."""
    other = "other " if beside_shown else ""
    name = counted(len(others), f"{other}tooth", f"{other}teeth")
    return name if any(tooth.stands for tooth in others) else f"{name}, no loss clear of noise"


def _newly_lost(found: HistoryTrends) -> list[ToothTrend]:
    """Return what the newest recording calls lost, however few recordings do."""
    newest = found.history.entries[-1]
    lost = [
        own
        for own in found.teeth
        if newest.verdict == "fault"
        and own.trend.series.time_s[-1] == newest.time_s
        and own.low[-1] > 0
    ]
    return sorted(lost, key=lambda own: -own.low[-1])


def _estimates(tooth: ToothTrend, number: int, more: str, ax: Axes) -> None:
    series, colour = tooth.trend.series, plots.series_colour(number)
    # the recordings' own 90 % intervals
    reach = np.maximum([series.value - tooth.low, tooth.high - series.value], 0.0)
    name = gear_text(tooth.stage, tooth.gear, tooth.tooth)
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


def _scores(found: HistoryTrends, ax: Axes) -> None:
    entries = found.history.entries
    times = _days([entry.time_s for entry in entries])
    verdicts = [entry.verdict for entry in entries]
    plots.plot_verdicts(times, [entry.score for entry in entries], verdicts, ax, 4)
    shade = {"color": plots.GREY, "alpha": 0.2}
    _mark_changes(found.evidence.changes, "evidence changed (interval shaded)", shade, ax)
    ax.set_ylabel("Score (−log₁₀ p)")
    low, high = ax.get_ylim()
    ax.set_ylim(min(0.0, low), max(high, _LEAST_SCORE))
    plots.light_grid(ax)


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
