"""``piezo emulate``: a controller without hardware, to rehearse an experiment and its failures over a real socket."""

from __future__ import annotations

import argparse
import threading

from ..stage.gcs2.emulator.controller import Controller
from ..stage.gcs2.emulator.faults import LASTING, ONCE, Fault
from ..stage.gcs2.emulator.server import Server
from ..stage.simulated import SimulatedStage
from .plant_option import add_plant_arguments, plant
from .terminal import console


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    listed = "\n".join(
        f"  {kind:18s}{what}" for kind, what in (*((k, w) for k, (_, w) in ONCE.items()), *LASTING.items())
    )
    parser = subparsers.add_parser(
        "emulate",
        description=__doc__,
        epilog=f"faults, as KIND, KIND@COMMAND or KIND@COMMAND:OCCURRENCE=VALUE:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("controller", choices=("gcs2",), help="what is emulated: a PI GCS 2.0 controller")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen at (default: this machine only)")
    parser.add_argument("--port", type=int, default=50000, help="TCP port, 0 for any free one (default: 50000)")
    add_plant_arguments(parser)
    parser.add_argument("--servo-time", metavar="S", type=float, default=50e-6, help="[s] (default: 5e-05)")
    parser.add_argument("--command-per-volt", metavar="C", type=float, default=1.0, help="SVA over piezo volt")
    parser.add_argument("--fault", action="append", default=[], metavar="FAULT", help="a failure to play; repeatable")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Serve until interrupted; returns 0.

    Raises
    ------
    ParameterError, StageError
        On a plant, a fault or a port that is not acceptable.
    """
    faults = [Fault.parse(text) for text in args.fault]
    parameters, _ = plant(args)
    stage = SimulatedStage(parameters, seed=args.seed, sample_period=args.servo_time)
    controller = Controller(
        stage, serial=str(args.seed), command_per_volt=args.command_per_volt, faults=faults, speed=1.0
    )
    with Server(controller, args.host, args.port) as server:
        gain = stage.description.amplifier_gain
        console().print(
            f"GCS 2.0 at {server.host}:{server.port}, axis 1, servo time {args.servo_time:g} s, "
            f"{stage.description.voltage_min * gain:g} to {stage.description.voltage_max * gain:g} V at the piezo; "
            "end with Ctrl-C"
        )
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            console().print("ended")
    return 0
