"""Signatures: order lines with amplitude, phase and origin; expected, measured, stored."""
