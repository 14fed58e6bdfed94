"""Comparison of signatures, detection and flags."""
