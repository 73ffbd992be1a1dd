"""``piezo simulate``: play a protocol to the simulated stage and record it, to rehearse without hardware or ROS."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import yaml

from .. import recording
from ..errors import ParameterError, RecordingError
from ..identification import protocol
from ..identification.drive import DriveLimits
from ..record import Experiment, Record
from ..stage.hidden import hidden_effect
from ..stage.plant import PlantParameters
from ..stage.simulated import SimulatedStage
from .json_file import write_json
from .terminal import console, progress

PROTOCOLS = {"paper": protocol.paper, "short": protocol.short, "rich": protocol.rich}


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("simulate", description=__doc__)
    parser.add_argument("-o", "--output", metavar="FOLDER", required=True, help="experiment to write")
    parser.add_argument("--protocol", choices=tuple(PROTOCOLS), default="short", help="what is played (default: short)")
    parser.add_argument("--plant", metavar="FILE", help="YAML with parameters of the stage, part.quantity: value")
    parser.add_argument("--seed", type=int, default=0, help="of noise and random drives (default: 0)")
    parser.add_argument("--noise", metavar="SHARE", type=float, help="sensor noise, rms over full stroke, e.g. 0.0005")
    parser.add_argument("--hidden", metavar="SEED", type=int, help="hide an effect drawn by this seed in the stage")
    parser.add_argument("--truth", metavar="FILE", help="write what was hidden to this JSON file")
    parser.add_argument("--sample-period", metavar="S", type=float, default=2e-5, help="[s] (default: 2e-05)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Simulate and write the experiment; returns 0.

    Raises
    ------
    ParameterError, StageError, RecordingError
        On a plant file, an option or a folder that is not acceptable.
    """
    parameters = _plant(args.plant)
    if args.noise is not None:
        parameters = parameters.with_values({"sensor.noise": args.noise})
    truth: dict[str, Any] = {"name": None, "changes": {}}
    if args.hidden is not None:
        hidden = hidden_effect(args.hidden, parameters, highest_voltage=parameters.electronics.voltage_max)
        parameters, truth = hidden.parameters, {"name": hidden.name, "changes": hidden.changes}
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
    with progress("simulate") as tell:
        for phase in phases:
            tell(phase.name, done / phases.summary.duration)
            records.append(stage.play(phase.voltage, phase.name, continues=bool(records), average=phase.stored_every))
            done += phase.duration
    recording.write(Experiment(tuple(records)), args.output)
    if args.truth is not None:
        write_json(args.truth, truth)
    console().print(f"wrote {len(records)} phases to {args.output}")
    return 0


def _plant(path: str | None) -> PlantParameters:
    if path is None:
        return PlantParameters()
    try:
        mapping = yaml.safe_load(Path(path).expanduser().read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}, expected a YAML file") from None
    except (yaml.YAMLError, UnicodeError) as error:
        raise ParameterError(f"{path}: broken YAML ({' '.join(str(error).split())[:120]})") from None
    if not isinstance(mapping, dict):
        raise ParameterError(f"{path}: got a {type(mapping).__name__}, expected part.quantity: value")
    return PlantParameters.from_mapping(mapping)
