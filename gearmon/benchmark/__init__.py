"""Run time against error, measured."""
