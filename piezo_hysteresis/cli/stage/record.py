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

"""Play a protocol to a stage and record it, without ROS.

STAGE.yaml is a parameter file of the driver (config/driver.yaml): back end, its parameters, and limits. Checks, limits
and locks are those of the driver node. Ctrl-C brings the stage to its safe voltage. The phases that are complete
by then are written, also after an error.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ... import recording
from ...acquisition.phase_recorder import record_phases
from ...acquisition.session import DriverSession
from ...acquisition.settings import DRIVER, DriverSettings
from ...errors import ParameterError, counted
from ...identification.protocol.drive_limits import DriveLimits
from ...record import Experiment, Record
from ...stage.back_ends import BACK_ENDS
from ...stage.description import Description
from ...yaml_file import read_yaml
from ..options.destination import require_new_experiment
from ..options.whole_number import whole_number
from ..terminal import console, progress
from .safe_session import safe_session, uninterrupted
from .simulate import PROTOCOLS


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("record", description=__doc__)
    parser.add_argument("stage", metavar="STAGE.yaml", type=Path, help="parameter file of the driver")
    parser.add_argument("protocol", choices=tuple(PROTOCOLS), help="protocol to play")
    parser.add_argument("-o", "--output", metavar="FOLDER", required=True, help="experiment to write")
    parser.add_argument("--seed", type=whole_number, default=0, help="seed of the random waveforms (default: 0)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Play, record, and write the experiment; returns 0.

    Raises
    ------
    PiezoError
        If a file, a stage, limits or a folder is not acceptable. The stage is then at its safe voltage.
    """
    require_new_experiment("-o", args.output)
    settings, values = read_stage(args.stage)
    phases: list[list[Record]] = []
    limits: Description | None = None
    try:
        with safe_session(settings, values, f"a recording with {args.stage.resolve()}") as session:
            limits = session.limits
            protocol = PROTOCOLS[args.protocol](drive_limits(session), args.seed)
            console().print(f"{limits.name}\n{args.protocol}: {protocol.summary}")
            played = 0.0
            durations = iter([phase.duration for phase in protocol])
            with progress("record") as show:

                def phase_begins(name: str) -> None:
                    nonlocal played
                    show(name, played / protocol.summary.duration)
                    played += next(durations)

                planned = ((p.name, p.voltage, p.stored_every) for p in protocol)
                record_phases(session, planned, phase_begins, phases.append)
    except KeyboardInterrupt:
        safe = f"{limits.name} is at its safe voltage, {limits.safe_voltage:g} V; " if limits else ""
        raise KeyboardInterrupt(f"{safe}{_write(phases, args.output)}") from None
    except BaseException:
        console().print(_write(phases, args.output))
        raise
    console().print(_write(phases, args.output))
    return 0


def _write(phases: list[list[Record]], output: str) -> str:
    """Write the phases that are complete; returns what was written."""
    records = [record for phase in phases for record in phase]
    if not records:
        return "nothing was written"
    with uninterrupted():
        recording.write(Experiment(tuple(records)), output)
    return f"wrote {counted(len(records), 'record')} of {counted(len(phases), 'complete phase')} to {output}"


def read_stage(path: Path) -> tuple[DriverSettings, dict[str, Any]]:
    """Settings of a driver and values of its back end, from a ROS parameter file keyed ``/**``.

    Raises
    ------
    ParameterError
        On a name that is no parameter of the driver, or a value that is not acceptable.
    """
    content = read_yaml(path)
    given = content.get("/**") if isinstance(content, Mapping) else None
    parameters = given.get("ros__parameters") if isinstance(given, Mapping) else None
    if not isinstance(parameters, Mapping):
        raise ParameterError(
            f"{path}: got no 'ros__parameters' under the heading '/**:', expected a parameter file of the driver"
        )
    return checked_settings(_flat(parameters), path)


def checked_settings(given: Mapping[str, Any], path: Path) -> tuple[DriverSettings, dict[str, Any]]:
    """Settings of a driver and values of its back end, from names with points between their parts.

    Raises
    ------
    ParameterError
        On a name that is no parameter of the driver, or a value that is not acceptable.
    """
    rows = {row.name: row for row in DRIVER} | {
        f"{word}.{row.name}": row for word, back_end in BACK_ENDS.items() for row in back_end.rows
    }
    unknown = sorted(set(given) - set(rows))
    if unknown:
        raise ParameterError(f"{path}: {unknown[0]} is no parameter of the driver; docs/ros.md lists them")
    checked = {name: row.check(given.get(name, row.value), "") for name, row in rows.items()}
    settings = DriverSettings.from_values(checked)
    word = f"{settings.stage}."
    return settings, {name.removeprefix(word): value for name, value in checked.items() if name.startswith(word)}


def drive_limits(session: DriverSession) -> DriveLimits:
    """Limits of an opened stage."""
    force = session.in_force()
    names = ("voltage_min", "voltage_max", "safe_voltage", "max_slew_rate", "ramp_rate")
    return DriveLimits(session.sample_period, **{name: float(force[name]) for name in names})


def _flat(parameters: Mapping[Any, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as names with points between their parts."""
    flat: dict[str, Any] = {}
    for name, value in parameters.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat
