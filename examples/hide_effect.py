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

"""Write the plant file of a simulated stage with a hidden physical effect, and print nothing.

No two stages are alike: loop, gain and mechanics also differ from those of the paper, and identification has to find
them. The demo starts this before the driver, gives the driver the path, and reads the file only after the verdict.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import yaml

from piezo_hysteresis.stage.hidden import HIDDEN_EFFECTS, hidden_effect
from piezo_hysteresis.stage.plant import PlantParameters

INDIVIDUAL = (
    "hysteresis.A",
    "hysteresis.beta",
    "hysteresis.p1",
    "hysteresis.p2",
    "structure.dc_gain",
    "structure.frequency1",
    "structure.damping1",
)
"""Quantities that differ from stage to stage by some per cent."""


def individual_stage(seed: int) -> PlantParameters:
    """The stage of the paper with its own numbers, nothing hidden."""
    usual = PlantParameters().to_mapping()
    factors = np.exp(np.random.default_rng([seed, 1]).normal(0.0, 0.05, len(INDIVIDUAL)))
    return PlantParameters().with_values({name: usual[name] * f for name, f in zip(INDIVIDUAL, factors, strict=True)})


def main() -> None:
    """Draw an effect and write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seed", type=int, help="the same seed hides the same effect")
    parser.add_argument("file", type=Path, help="plant file to write")
    parser.add_argument("--name", choices=HIDDEN_EFFECTS, help="hide this effect; only its size is drawn")
    arguments = parser.parse_args()
    stage = individual_stage(arguments.seed)
    hidden = hidden_effect(arguments.seed, stage, name=arguments.name)
    mapping = {key: list(v) if isinstance(v, tuple) else v for key, v in hidden.parameters.to_mapping().items()}
    sizes = ", ".join(f"{name} = {value}" for name, value in hidden.changes.items())
    arguments.file.write_text(f"# hidden: {hidden.name} ({sizes})\n" + yaml.safe_dump(mapping, sort_keys=False))


if __name__ == "__main__":
    main()
