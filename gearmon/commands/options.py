"""Options that several commands have."""

from __future__ import annotations

import argparse

_FAULT = "such as crack:1:pinion:5:20%%, a loss of the tooth pair's stiffness, or 1.5mm"
_ERRORS = (
    "also errors, such as eccentricity:1:pinion:all:20um, pitch:1:gear:7:8um or "
    "cumulative:1:gear:all:15um"
)


def machine_argument(parser: argparse.ArgumentParser) -> None:
    """Add the machine file as the first argument."""
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")


def fault_option(parser: argparse.ArgumentParser, *, errors: bool = False) -> None:
    """Add --fault; `errors` tells of those that only a baseline knows."""
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="KIND:STAGE:GEAR:TOOTH:SIZE",
        help=f"{_FAULT}; {_ERRORS}; repeatable" if errors else f"{_FAULT}; repeatable",
    )


def recording_options(
    parser: argparse.ArgumentParser,
    *,
    machine_required: bool = True,
    several: bool = True,
    least: int = 1,
) -> None:
    """Add recordings, their machine, and how they are to be read.

    Parameters
    ----------
    parser : ArgumentParser
    machine_required : bool
    several : bool
        Whether more than one recording may be named.
    least : {0, 1}
        Recordings to be named at least.
    """
    option = parser.add_argument
    count: str | int = ("+" if least else "*") if several else 1
    option(
        "recording",
        metavar="RECORDING",
        nargs=count,
        help="CSV, plain or gzip; also WAV, FLAC, MATLAB, HDF5, TDMS, UFF 58, Parquet, NPY",
    )
    option("--machine", metavar="MACHINE", required=machine_required, help="machine file (TOML)")
    option("--sampling-rate", type=float, metavar="HZ", help="needed if the file does not hold it")
    option(
        "--channel",
        action="append",
        metavar="NAME|N",
        help="vibration channel by name or column number; repeatable (all by default)",
    )
    option("--tacho", metavar="NAME|N", help="channel with tachometer pulses")


def window_and_peaks(parser: argparse.ArgumentParser) -> None:
    """Add --window and --peaks."""
    option = parser.add_argument
    option(
        "--window",
        default="hann",
        metavar="NAME",
        help="hann (default), flat-top, blackman-harris or rectangular",
    )
    option("--peaks", type=int, default=12, metavar="N", help="peaks listed a channel (12)")
