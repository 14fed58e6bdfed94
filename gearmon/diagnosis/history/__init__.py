"""Many recordings of one machine: when something began, how it grows, and what is left.

Every analysed recording becomes an `Entry` of a `History`, which a file keeps (`append`,
`read_history`, `export_history`). `history_trends` follows the loss of each tooth, and the score,
through it: changes that noise would not make (`changes.find_changes`), the trend with its intervals
(`trends.fit_trend`), and when it reaches a limit. ::

    append("drive.db", [entry_of(analysis, read_time("2026-03-01T08:00Z"))])
    found = history_trends(read_history("drive.db"), limit=0.2)
    for tooth in found.shown:
        print(tooth.gear, tooth.tooth, tooth.now, tooth.crossing)
"""

from gearmon.lazy import lazily

_OFFERED = {
    "changes": ("ChangePoint",),
    "entries": ("Entry", "History", "Place", "entry_of", "recording_times", "time_text"),
    "store": ("append", "export_history", "read_history", "read_latest"),
    "trends": ("SECONDS_PER_DAY", "Crossing", "HistoryTrends", "ToothTrend", "history_trends"),
}
__all__, __getattr__ = lazily(__name__, _OFFERED)
