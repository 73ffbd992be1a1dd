# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Emulate a controller behind a TCP port, to rehearse an experiment and its faults without hardware."""

from __future__ import annotations

import argparse
import math
import os
import signal
import threading

from ...emulators.daqmx.card import Card
from ...emulators.daqmx.faults import FAULTS as NI_FAULTS
from ...emulators.daqmx.server import DaqmxServer
from ...emulators.gcs2.controller import Controller
from ...emulators.gcs2.faults import FAULTS as GCS2_FAULTS
from ...emulators.gcs2.server import Gcs2Server
from ...errors import ParameterError
from ...stage.simulated import SimulatedStage
from ...stage.simulated.simulation import LONGEST_PERIOD, SHORTEST_PERIOD
from ..options.plant_option import add_plant_arguments, plant
from ..terminal import console

_PORT = {"gcs2": 50000, "nidaqmx": 31763}
"""Default TCP port of every emulated device."""
_SERVO_TIME, _NI_PERIOD = 50e-6, 20e-6
"""Time between two samples of the stage behind each device [s]."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    listed = "\n".join(
        f"{name}:\n" + "\n".join(f"  {kind:18s}{what}" for kind, what in faults.meaning.items())
        for name, faults in (
            ("faults of gcs2, as KIND, KIND@COMMAND or KIND@COMMAND:OCCURRENCE=VALUE", GCS2_FAULTS),
            ("faults of nidaqmx; COMMAND is a call of NI's gRPC interface", NI_FAULTS),
        )
    )
    parser = subparsers.add_parser(
        "emulate", description=__doc__, epilog=listed, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "device",
        choices=tuple(_PORT),
        help="gcs2: a PI GCS 2.0 controller; nidaqmx: an NI gRPC device server with a card",
    )
    defaults = ", ".join(f"{port} for {device}" for device, port in _PORT.items())
    parser.add_argument("--host", default="127.0.0.1", help="address for connections (default: this machine only)")
    parser.add_argument("--port", type=int, help=f"TCP port, 0 for any free one (default: {defaults})")
    add_plant_arguments(parser)
    parser.add_argument(
        "--servo-time", metavar="S", type=float, help=f"gcs2: servo time [s] (default: {_SERVO_TIME:g})"
    )
    parser.add_argument(
        "--command-per-volt",
        metavar="C",
        type=float,
        help="gcs2: open-loop command over piezo voltage, not 0 (default: 1)",
    )
    parser.add_argument(
        "--fault", action="append", default=[], metavar="FAULT", help="fault to inject, see below (repeatable)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Serve until interrupted; returns 0.

    Raises
    ------
    ParameterError, StageError
        On a plant, a fault or a port that is not acceptable.
    """
    parameters, _ = plant(args)
    port = _PORT[args.device] if args.port is None else args.port
    gain = _checked_options(args)
    period = (args.servo_time or _SERVO_TIME) if args.device == "gcs2" else _NI_PERIOD
    stage = SimulatedStage(parameters, seed=args.seed, sample_period=period)
    server: Gcs2Server | DaqmxServer
    if args.device == "gcs2":
        faults = [GCS2_FAULTS.parse(text) for text in args.fault]
        serial = f"{args.seed}-{os.getpid()}"  # drivers take two controllers with one serial number for one device
        controller = Controller(stage, serial=serial, command_per_volt=gain, faults=faults)
        server = Gcs2Server(controller, args.host, port)
    else:
        server = DaqmxServer(Card(stage, faults=[NI_FAULTS.parse(text) for text in args.fault]), args.host, port)
    ended = threading.Event()
    for ending in (signal.SIGINT, signal.SIGTERM):  # also if a shell has made the process ignore them
        signal.signal(ending, lambda *_: ended.set())
    d = stage.description
    with server:
        console().print(
            f"{args.device} emulated at {args.host}:{server.port}, drive {d.voltage_min:g} to {d.voltage_max:g} V, "
            f"amplifier gain {d.amplifier_gain:g}; end with Ctrl-C"
        )
        ended.wait()
        console().print("ended")
    return 0


def _checked_options(args: argparse.Namespace) -> float:
    """Open-loop command over piezo voltage, after the options that belong to one device were checked."""
    if args.device != "gcs2":
        for option, value in (("--servo-time", args.servo_time), ("--command-per-volt", args.command_per_volt)):
            if value is not None:
                raise ParameterError(f"{option}: got {value:g} for {args.device}, expected it for gcs2 only")
    if args.servo_time is not None and not SHORTEST_PERIOD <= args.servo_time <= LONGEST_PERIOD:
        raise ParameterError(
            f"--servo-time: got {args.servo_time:g} s, expected {SHORTEST_PERIOD:g} to {LONGEST_PERIOD:g} s"
        )
    gain = 1.0 if args.command_per_volt is None else float(args.command_per_volt)
    if not math.isfinite(gain) or gain == 0.0:
        raise ParameterError(f"--command-per-volt: got {gain:g}, expected a finite number other than zero")
    return gain
