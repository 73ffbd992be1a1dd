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

"""Play a protocol to the simulated stage and record it. No hardware and no ROS are needed."""

from __future__ import annotations

import argparse

from ... import recording
from ...errors import counted
from ...identification.protocol import protocol
from ...identification.protocol.drive_limits import DriveLimits
from ...record import Experiment, Record
from ...report.json_file import write_json
from ...stage.simulated import SimulatedStage
from ..options.destination import require_new_experiment, require_new_file
from ..options.plant_option import add_plant_arguments, plant
from ..terminal import console, progress

PROTOCOLS = {"paper": protocol.paper, "short": protocol.short, "rich": protocol.rich}
"""Identification protocols that can be simulated."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("simulate", description=__doc__)
    parser.add_argument("-o", "--output", metavar="FOLDER", required=True, help="folder of the experiment to write")
    parser.add_argument(
        "--protocol", choices=tuple(PROTOCOLS), default="short", help="protocol to play (default: short)"
    )
    add_plant_arguments(parser)
    parser.add_argument("--truth", metavar="FILE", help="write the hidden effect to this JSON file")
    parser.add_argument(
        "--sample-period", metavar="S", type=float, default=2e-5, help="sample period [s] (default: 2e-05)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Simulate and write the experiment; returns 0.

    Raises
    ------
    ParameterError, StageError, RecordingError
        On a plant file, an option or a folder that is not acceptable.
    """
    require_new_experiment("-o", args.output)
    require_new_file("--truth", args.truth)
    parameters, truth = plant(args)
    stage = SimulatedStage(parameters, seed=args.seed, sample_period=args.sample_period)
    described = stage.description
    limits = DriveLimits(
        args.sample_period,
        described.voltage_min,
        described.voltage_max,
        described.safe_voltage,
        described.max_slew_rate,
    )
    phases = PROTOCOLS[args.protocol](limits, args.seed)
    console().print(f"{args.protocol}: {phases.summary}")
    records: list[Record] = []
    done = 0.0
    with progress("simulate") as report_progress:
        for phase in phases:
            report_progress(phase.name, done / phases.summary.duration)
            records.append(stage.play(phase.voltage, phase.name, continues=bool(records), average=phase.stored_every))
            done += phase.duration
    recording.write(Experiment(tuple(records)), args.output)
    if args.truth is not None:
        write_json(args.truth, truth)
    console().print(f"wrote {counted(len(records), 'phase')} to {args.output}")
    return 0
