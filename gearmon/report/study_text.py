"""The study told on a terminal."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import get_args

from gearmon.study.findings import Judged, Verdict

WIDTH = 100


def verdict_counts(judged: Sequence[Judged]) -> dict[str, int]:
    """Count the verdicts, in the order from reproduced to not checkable."""
    found = Counter(entry.finding.verdict for entry in judged)
    return {verdict: found[verdict] for verdict in get_args(Verdict)}


def claims_text(judged: Sequence[Judged]) -> list[str]:
    """One paragraph for every claim: key, verdict, claim, and what we find."""
    lines = []
    for entry in judged:
        head = f"{entry.claim.key:<4}{entry.finding.verdict.upper():<19}{entry.claim.text}"
        lines += textwrap.wrap(head, WIDTH, subsequent_indent=" " * 23)
        lines += textwrap.wrap(
            entry.finding.reason, WIDTH, initial_indent=" " * 23, subsequent_indent=" " * 23
        )
    counts = ", ".join(f"{count} {verdict}" for verdict, count in verdict_counts(judged).items())
    return [*lines, "", f"{len(judged)} claims: {counts}"]
