"""Many recordings of one machine: when something began, how it grows, and what is left.

Every analysed recording becomes an `Entry` of a `History`, which a file keeps (`append`,
`read_history`, `export_history`). `history_trends` follows the loss of each tooth, and the score,
through it: changes that noise would not make (`find_changes`), the trend with its intervals
(`fit_trend`), and when it reaches a limit. ::

    append("drive.db", [entry_of(analysis, read_time("2026-03-01T08:00Z"))])
    found = history_trends(read_history("drive.db"), limit=0.2)
    for tooth in found.shown:
        print(tooth.gear, tooth.tooth, tooth.now, tooth.crossing)
"""

from gearmon.diagnosis.history.entries import Entry, History, Place, entry_of
from gearmon.diagnosis.history.onset import find_changes
from gearmon.diagnosis.history.recording_times import recording_times, time_text
from gearmon.diagnosis.history.shapes import ChangePoint, Growth, Series
from gearmon.diagnosis.history.store import append, export_history, read_history
from gearmon.diagnosis.history.tooth import SECONDS_PER_DAY, ToothTrend
from gearmon.diagnosis.history.trend import Crossing, Trend, fit_trend
from gearmon.diagnosis.history.trends import HistoryTrends, history_trends

__all__ = [
    "SECONDS_PER_DAY",
    "ChangePoint",
    "Crossing",
    "Entry",
    "Growth",
    "History",
    "HistoryTrends",
    "Place",
    "Series",
    "ToothTrend",
    "Trend",
    "append",
    "entry_of",
    "export_history",
    "find_changes",
    "fit_trend",
    "history_trends",
    "read_history",
    "recording_times",
    "time_text",
]
