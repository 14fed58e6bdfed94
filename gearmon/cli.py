"""Arguments -> one call -> output and exit code."""

from __future__ import annotations


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    raise SystemExit(2)
