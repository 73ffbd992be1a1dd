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

"""Measure the delay of a card whose output is wired to its input, and write a parameter file for the driver.

Disconnect the stage and the amplifier first, because the card puts out noise. The driver subtracts the measured delay
from its recordings, so that only the delay of the stage remains.
"""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

from ...acquisition.stage_lock import StageLock
from ...errors import ParameterError, RecordingError, StageError
from ...model.parameter_file import number
from ...stage.daqmx.loop_back import loop_back_delay
from ...stage.daqmx.setup import DaqmxSetup
from ...stage.daqmx.stage import DaqmxStage
from ..options.destination import add_force, require_new_results
from ..terminal import console
from .safe_session import closed_safely


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    default = DaqmxSetup("-", max_slew_rate=1.0)
    parser = subparsers.add_parser("calibrate", description=__doc__)
    parser.add_argument("device", help="name of the National Instruments card, as NI MAX shows it")
    parser.add_argument(
        "--server", metavar="HOST:PORT", default="", help="NI gRPC device server (default: this machine)"
    )
    parser.add_argument(
        "--wired-output",
        metavar="NAME",
        default=default.output,
        help=f"analogue output that is wired (default: {default.output})",
    )
    parser.add_argument(
        "--wired-input",
        metavar="NAME",
        default=default.displacement_input,
        help=f"analogue input that is wired (default: {default.displacement_input})",
    )
    parser.add_argument(
        "--sample-period",
        metavar="S",
        type=float,
        default=default.sample_period,
        help=f"time between samples [s] (default: {default.sample_period})",
    )
    parser.add_argument("--amplitude", metavar="V", type=float, default=1.0, help="peak of the noise [V] (default: 1)")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="parameter file to write")
    add_force(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure and write; returns 0.

    Raises
    ------
    ParameterError
        If the sample period or the amplitude is not positive.
    StageError
        If the card is not there or has a driver, or output and input are not wired together.
    RecordingError
        If the file exists or cannot be written.
    """
    require_new_results(args)
    if not args.sample_period > 0.0:
        raise ParameterError(f"--sample-period: got {args.sample_period:g} s, expected a positive time")
    setup = DaqmxSetup(
        args.device,
        output=args.wired_output,
        displacement_input=args.wired_input,
        server=args.server,
        sample_period=args.sample_period,
        sensor_gain=1.0,
        max_slew_rate=20.0 / args.sample_period,  # nothing is connected that a step could harm
    )
    span = setup.voltage_max - setup.voltage_min
    if not 0.0 < args.amplitude <= span:
        raise ParameterError(f"--amplitude: got {args.amplitude:g} V, expected more than 0 and at most {span:g} V")
    try:
        delay = _measured(setup, args.amplitude)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{args.device} is at {setup.safe_voltage:g} V; nothing was written") from None
    wired = f"{args.device}, {args.wired_output} to {args.wired_input}"
    text = (
        f"# Delay of {wired}, at {args.sample_period:g} s per sample, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC\n"
        f"/**:\n  ros__parameters:\n    nidaqmx.io_delay: {number(max(delay, 0.0))}\n"
    )
    try:
        args.output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write {args.output} ({error.strerror})") from None
    console().print(
        f"{wired}: {1e6 * delay:.2f} µs, {delay / args.sample_period:.2f} samples; written to {args.output}"
    )
    return 0


def _measured(setup: DaqmxSetup, amplitude: float) -> float:
    """The delay of a card [s], locked while it is used; the output is brought to its safe voltage at the end."""
    lock = StageLock([])
    try:
        with closed_safely(lambda: DaqmxStage(setup)) as stage:
            try:
                lock.add(f"device {stage.description.name}")
            except StageError:
                stage.leave()
                raise
            return loop_back_delay(stage, amplitude)
    finally:
        lock.release()
