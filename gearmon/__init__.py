"""Gear condition monitoring that starts from physics."""

__version__ = "0.1.0"
