"""Arguments -> one call -> output and exit code; nobody imports this module.

Exit codes: 0 done and no flag raised, 1 done and a flag raised, 2 bad input or usage. Everything
heavy is imported inside the command that needs it.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from gearmon import __version__, commands
from gearmon.commands import BAD_INPUT, DONE
from gearmon.commands.families import run_family
from gearmon.commands.history import run_history
from gearmon.errors import GearmonError


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit code.
    """
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.print_help()
        return DONE
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # file names need not be text
    try:
        commands.check_names(arguments)
        code: int = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except GearmonError as error:
        print(f"gearmon: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("gearmon: stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # whoever reads the output has seen enough; stop Python from complaining at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gearmon",
        description="Gear condition monitoring that starts from physics.",
        epilog="Every command explains itself: gearmon COMMAND --help",
    )
    parser.add_argument("--version", action="version", version=f"gearmon {__version__}")
    parsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    for add in (
        _lines,
        _stiffness,
        _baseline,
        _family,
        _stability,
        _simulate,
        _learn,
        _analyse,
        _history,
        _indicators,
        _spectrum,
        _orders,
        _harvest,
        _demo,
        _benchmark,
    ):
        add(parsers)
    return parser


def _command(
    parsers: Any, name: str, run: Callable[[argparse.Namespace], int], help_: str, example: str
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = parsers.add_parser(
        name,
        help=help_,
        description=help_[0].upper() + help_[1:] + ".",
        epilog=f"example: {example}",
    )
    parser.set_defaults(run=run)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("-o", "--output", metavar="PATH", help="write the result to this file")
    return parser


def _lines(parsers: Any) -> None:
    parser = _command(
        parsers,
        "lines",
        commands.run_lines,
        "orders and frequencies of every shaft, mesh, assembly phase, hunting tooth and bearing",
        "gearmon lines machine.toml",
    )
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")


def _stiffness(parsers: Any) -> None:
    parser = _command(
        parsers,
        "stiffness",
        commands.run_stiffness,
        "mesh stiffness over a mesh period or a turn, healthy and damaged, as table and picture",
        "gearmon stiffness machine.toml --fault crack:1:pinion:5:1.5mm -o stiffness.csv",
    )
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")
    _fault_option(parser)
    parser.add_argument(
        "--form",
        default="potential-energy",
        help="stiffness form (potential-energy), or all: four forms and their spectra side by side",
    )
    parser.add_argument("--stage", type=int, metavar="N", help="only this stage")


def _baseline(parsers: Any) -> None:
    parser = _command(
        parsers,
        "baseline",
        commands.run_baseline,
        "the spectrum that a healthy (or damaged) machine should emit, from its gear data",
        "gearmon baseline machine.toml --fault crack:1:pinion:5:20% -o lines.csv",
    )
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")
    _fault_option(parser)
    parser.add_argument(
        "--tolerance", type=float, default=1e-6, help="relative error of the acceleration (1e-6)"
    )
    parser.add_argument("--max-hz", type=float, metavar="F", help="no lines above this frequency")


def _family(parsers: Any) -> None:
    parser = _command(
        parsers,
        "family",
        run_family,
        "the spectra of every kind and size of fault of every gear, as table and picture",
        "gearmon family machine.toml --kind crack --kind pitting --size 5% --size 20% -o f.csv",
    )
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")
    option = parser.add_argument
    option("--kind", action="append", metavar="KIND", help="such as crack; repeatable (nine kinds)")
    option(
        "--size",
        action="append",
        metavar="SIZE",
        help="such as 20%% or 1.5mm, of errors 20um; repeatable (2.5%% to 40%%, 5um to 40um)",
    )
    option("--gear", action="append", metavar="STAGE:GEAR", help="such as 1:pinion; repeatable")
    option(
        "--operating",
        action="append",
        type=int,
        metavar="N",
        help="operating point, from 0; repeatable (all)",
    )
    option("--max-hz", type=float, metavar="F", help="no lines above this frequency")
    option("--tolerance", type=float, default=1e-6, help="relative error of what a fault adds")
    option("--mesh-harmonics", type=int, metavar="N", help="write no lines about higher ones")
    option("--sidebands", type=int, metavar="N", help="write no sidebands farther off")


def _stability(parsers: Any) -> None:
    parser = _command(
        parsers,
        "stability",
        commands.run_stability,
        "how far each mesh is from parametric instability, as table and chart",
        "gearmon stability machine.toml -o stability.csv",
    )
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")
    parser.add_argument("--form", default="parabolic", help="stiffness form (parabolic)")
    parser.add_argument("--stage", type=int, metavar="N", help="only this stage")
    parser.add_argument(
        "--harmonics", type=int, default=12, metavar="N", help="stiffness harmonics taken (12)"
    )


def _simulate(parsers: Any) -> None:
    parser = _command(
        parsers,
        "simulate",
        commands.run_simulate,
        "write a recording of a simulated machine (CSV), with the truth beside it (JSON)",
        "gearmon simulate machine.toml --fault crack:1:pinion:5:20% -o cracked.csv",
    )
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")
    _fault_option(parser)
    option = parser.add_argument
    option("--duration", type=float, default=10.0, metavar="S", help="length in s (10)")
    option("--sampling-rate", type=float, default=20000.0, metavar="HZ", help="(20000)")
    option("--channels", type=int, default=2, metavar="N", help="vibration channels (2)")
    option("--load", type=float, default=1.0, metavar="F", help="share of the nominal torque (1)")
    option("--speed-drift", type=float, default=0.005, metavar="F", help="wander, relative (0.005)")
    option("--load-drift", type=float, default=0.03, metavar="F", help="wander, relative (0.03)")
    option("--snr-db", type=float, default=20.0, metavar="DB", help="vibration over noise (20)")
    option("--tacho", action="store_true", help="add a column with one pulse a turn of shaft 1")
    option("--no-time", action="store_true", help="leave out the time column")
    option("--seed", type=int, default=0, metavar="N", help="seed of the recording (0)")
    option("--machine-seed", type=int, default=0, metavar="N", help="seed of the machine (0)")


def _learn(parsers: Any) -> None:
    parser = _command(
        parsers,
        "learn",
        commands.run_learn,
        "build a healthy reference from one or more healthy recordings, best at several loads",
        "gearmon learn idle.csv half.csv full.csv --machine machine.toml -o healthy.ref",
    )
    _recording_options(parser)


def _analyse(parsers: Any) -> None:
    parser = _command(
        parsers,
        "analyse",
        commands.run_analyse,
        "say whether the machine of a recording is healthy, and why",
        "gearmon analyse new.csv --machine machine.toml --reference healthy.ref "
        "--report report.html",
    )
    _recording_options(parser)
    parser.add_argument(
        "--reference",
        metavar="PATH",
        help="what gearmon learn wrote, or one healthy recording",
    )
    parser.add_argument("--report", metavar="HTML", help="write a report, and a PNG a picture")


def _history(parsers: Any) -> None:
    parser = _command(
        parsers,
        "history",
        run_history,
        "follow a machine through many recordings: loss of each tooth, when it began, what is left",
        "gearmon history *.csv --machine machine.toml --reference healthy.ref --time-from name "
        "--store history.db --limit 20% -o history.csv",
    )
    _recording_options(parser, least=0)
    option = parser.add_argument
    option("--reference", metavar="PATH", help="what gearmon learn wrote, or a healthy recording")
    option("--store", metavar="DB", help="keep the history in this file, and go on with it")
    option("--times", metavar="ISO8601,...", help="when each was made; without an offset UTC")
    option("--time-from", metavar="SOURCE", help="name (of the file) or modified")
    option("--limit", metavar="LOSS", help="of pair stiffness at which to act, such as 20%%")
    option("--replace", action="store_true", help="recordings of the same time give way")


def _indicators(parsers: Any) -> None:
    parser = _command(
        parsers,
        "indicators",
        commands.run_indicators,
        "every condition indicator of recordings, with its input; several are the records of a run",
        "gearmon indicators monday.csv tuesday.csv --machine machine.toml -o indicators.csv",
    )
    _recording_options(parser, machine_required=False)
    parser.add_argument(
        "--baseline",
        type=int,
        default=1,
        metavar="N",
        help="records at the start of the run that were healthy, for NA4* and NB4* (1)",
    )
    parser.add_argument(
        "--history", metavar="FILE", help="go on with the run in this file (JSON), and write it"
    )


def _spectrum(parsers: Any) -> None:
    parser = _command(
        parsers,
        "spectrum",
        commands.run_spectrum,
        "a calibrated spectrum of a recording, of any kind, as table and picture",
        "gearmon spectrum new.csv --kind envelope --band 2000 4000 --machine machine.toml "
        "-o spectrum.csv",
    )
    _recording_options(parser, machine_required=False, several=False)
    parser.add_argument(
        "--kind",
        default="amplitude",
        metavar="KIND",
        help="amplitude (peak; default), rms, density, energy, envelope, cepstrum, kurtogram or "
        "coherence",
    )
    parser.add_argument(
        "--band",
        type=float,
        nargs=2,
        metavar=("LO", "HI"),
        help="in Hz: what is shown; for envelope the band that is demodulated; for coherence the "
        "modulation frequencies; for cepstrum quefrencies in s",
    )
    _window_and_peaks(parser)


def _orders(parsers: Any) -> None:
    parser = _command(
        parsers,
        "orders",
        commands.run_orders,
        "order spectrum, order map, and the synchronous average of every gear with its scatter",
        "gearmon orders new.csv --machine machine.toml --shaft 2 -o orders.csv",
    )
    _recording_options(parser, several=False)
    option = parser.add_argument
    option("--shaft", type=int, default=1, metavar="N", help="whose turns orders count (1)")
    option("--map", action="store_true", help="write the map only, in full resolution")
    option("--against", default="time", metavar="WHAT", help="of the map: time (default) or speed")
    option("--max-order", type=float, metavar="X", help="no orders above this one")
    _window_and_peaks(parser)


def _window_and_peaks(parser: argparse.ArgumentParser) -> None:
    option = parser.add_argument
    option(
        "--window",
        default="hann",
        metavar="NAME",
        help="hann (default), flat-top, blackman-harris or rectangular",
    )
    option("--peaks", type=int, default=12, metavar="N", help="peaks listed a channel (12)")


def _harvest(parsers: Any) -> None:
    parser = _command(
        parsers,
        "harvest",
        commands.run_harvest,
        "say where to put a vibration energy harvester, how to tune it and what it will power",
        "gearmon harvest machine.toml full.csv idle.csv --share 0.7 --share 0.3 -o harvest.json",
    )
    option = parser.add_argument
    option("machine", metavar="MACHINE", help="machine file (TOML)")
    option(
        "recording",
        metavar="RECORDING",
        nargs="*",
        help="one for each operating point, every vibration channel a position; without any, the "
        "expected lines of the machine are used",
    )
    option("--harvester", metavar="FILE", help="harvester file (TOML); a 15 mm bimorph by default")
    option("--count", type=int, default=1, metavar="N", help="harvesters of a set, 1 to 3 (1)")
    option("--share", action="append", type=float, metavar="F", help="share of time, repeatable")
    option(
        "--degraded",
        action="append",
        default=[],
        metavar="RECORDING",
        help="the same operating point with a damaged gear; repeatable, in the same order",
    )
    _fault_option(parser)
    option("--path-gain", type=float, default=1.0, metavar="G", help="mesh to harvester (1)")
    option("--wander", type=float, default=0.005, metavar="F", help="of speed, relative (0.005)")
    option("--sampling-rate", type=float, metavar="HZ", help="needed if there is no time column")
    option("--channel", action="append", metavar="NAME|N", help="only these channels; repeatable")
    option("--tacho", metavar="NAME|N", help=argparse.SUPPRESS)


def _demo(parsers: Any) -> None:
    parser = _command(
        parsers,
        "demo",
        commands.run_demo,
        "run a whole job on data it makes itself",
        "gearmon demo",
    )
    parser.add_argument(
        "name",
        metavar="NAME",
        nargs="?",
        default="crack",
        help="crack (found; default), growth (of a crack), kinds (pitting, wear and eccentricity "
        "told apart), day (of a sound machine), harvest, study",
    )


def _benchmark(parsers: Any) -> None:
    parser = _command(
        parsers,
        "benchmark",
        commands.run_benchmark,
        "measure run time, memory and error, side by side with named competitors",
        "gearmon benchmark dynamics --quick -o benchmark.csv",
    )
    option = parser.add_argument
    option("--quick", action="store_true", help="rough figures in seconds")
    option("--seed", type=int, default=0, metavar="N", help="of what is drawn at random (0)")
    option("--count", type=int, metavar="N", help="random systems, parameter sets or machines")
    option("--ross-python", metavar="PATH", help="interpreter of an environment with ROSS")
    parser.add_argument(
        "case",
        metavar="CASE",
        nargs="?",
        default="analyse",
        help="analyse (default), memory, stiffness, signals, harvesting, dynamics, stress or "
        "detection",
    )


def _fault_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="KIND:STAGE:GEAR:TOOTH:SIZE",
        help="such as crack:1:pinion:5:20%%, a loss of the tooth pair's stiffness, or 1.5mm; in a "
        "baseline also errors, such as eccentricity:1:pinion:all:20um, pitch:1:gear:7:8um or "
        "cumulative:1:gear:all:15um; repeatable",
    )


def _recording_options(
    parser: argparse.ArgumentParser,
    *,
    machine_required: bool = True,
    several: bool = True,
    least: int = 1,
) -> None:
    option = parser.add_argument
    count: str | int = ("+" if least else "*") if several else 1
    option("recording", metavar="RECORDING", nargs=count, help="CSV file, plain or gzip")
    option("--machine", metavar="MACHINE", required=machine_required, help="machine file (TOML)")
    option("--sampling-rate", type=float, metavar="HZ", help="needed if there is no time column")
    option(
        "--channel",
        action="append",
        metavar="NAME|N",
        help="vibration channel by name or column number; repeatable (all by default)",
    )
    option("--tacho", metavar="NAME|N", help="channel with tachometer pulses")
