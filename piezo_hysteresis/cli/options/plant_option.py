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

"""Selection of the simulated stage: the options that ``piezo simulate`` and ``piezo emulate`` share."""

from __future__ import annotations

import argparse
from typing import Any

from ...errors import ParameterError
from ...home_path import in_home
from ...stage.hidden import hidden_effect
from ...stage.plant import PlantParameters
from ...yaml_file import read_yaml
from .whole_number import whole_number


def add_plant_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``--plant``, ``--seed``, ``--noise`` and ``--hidden``."""
    parser.add_argument(
        "--plant", metavar="FILE", help="YAML file with parameters of the stage, e.g. creep.gamma: 0.015"
    )
    parser.add_argument(
        "--seed", type=whole_number, default=0, help="seed of the noise and of random waveforms (default: 0)"
    )
    parser.add_argument("--noise", metavar="SHARE", type=float, help="RMS sensor noise over full stroke, e.g. 0.0005")
    parser.add_argument("--hidden", metavar="SEED", type=whole_number, help="hide an effect that this seed selects")


def plant(args: argparse.Namespace) -> tuple[PlantParameters, dict[str, Any]]:
    """The chosen plant, and its hidden effect: ``name`` and ``changes``.

    Raises
    ------
    ParameterError, RecordingError
        If a file or an option is not acceptable.
    """
    parameters = _read(args.plant)
    if args.noise is not None:
        try:
            parameters = parameters.with_values({"sensor.noise": args.noise})
        except ParameterError as error:
            raise ParameterError(str(error).replace("sensor.noise", "--noise", 1)) from None
    if args.hidden is None:
        return parameters, {"name": None, "changes": {}}
    hidden = hidden_effect(args.hidden, parameters)
    return hidden.parameters, {"name": hidden.name, "changes": hidden.changes}


def _read(path: str | None) -> PlantParameters:
    if path is None:
        return PlantParameters()
    mapping = read_yaml(in_home(path))
    if not isinstance(mapping, dict):
        raise ParameterError(f"{path}: got a {type(mapping).__name__}, expected part.quantity: value")
    return PlantParameters.from_mapping(mapping)
