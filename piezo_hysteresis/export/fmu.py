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

"""A model as FMI 3.0 co-simulation units (FMU): C program, description, and a library if there is a compiler."""

from __future__ import annotations

import io
import math
import os
import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from .. import __version__
from ..compensation import Inverse
from ..errors import ModelError
from ..model.chain import RUNAWAY
from ..model.model import Model
from .prediction import prediction
from .program import c_program, model_hash, templates

UNITS = {"s": 's="1"', "V": 'kg="1" m="2" s="-3" A="-1"', "m": 'm="1"', "K": 'K="1"'}
"""Units of the variables, as XML attributes with the exponents of the SI base units."""
INTERFACE = "fmi3"
"""Name of the source file with the interface of FMI, of which the unit of a model consists beside its own."""
FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off")
"""Options of the compiler."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Input or output of a co-simulation unit.

    Parameters
    ----------
    name : str
        Name of the variable.
    unit : str
        SI unit, a key of `UNITS`.
    meaning : str
        Description.
    start : float
        Start value [`unit`].
    """

    name: str
    unit: str
    meaning: str
    start: float = 0.0


VOLTAGE = Quantity("voltage", "V", "drive voltage before the amplifier")
"""Input of the prediction, output of the inverse."""
DISPLACEMENT = Quantity("displacement", "m", "displacement of the stage")
"""Output of the prediction, input of the inverse."""
CHANNELS = {
    "other_displacement": Quantity("other_displacement", "m", "displacement of the other axis"),
    "temperature": Quantity("temperature", "K", "temperature of the stage", 293.15),
}
"""Further measured inputs."""


@dataclass(frozen=True, slots=True)
class CoSimulation:
    """Description of one co-simulation unit.

    Parameters
    ----------
    identifier : str
        Name of the unit and of its library.
    prefix : str
        Prefix of its functions in the C program: empty, or ``"inverse_"``.
    token : str
        Text that differs between units of different models.
    description : str
        Description in one sentence.
    inputs, output : tuple of Quantity, Quantity
        Inputs in the order of the arguments of the C function, and its output.
    limit : float
        Outputs with a larger magnitude mean that the model diverges [unit of the output].
    """

    identifier: str
    prefix: str
    token: str
    description: str
    inputs: tuple[Quantity, ...]
    output: Quantity
    limit: float


def fmus(model: Model, name: str = "piezo", inverse: Inverse | None = None) -> Mapping[str, bytes]:
    """Write a model as co-simulation units.

    They contain their C sources, and a library for this computer if it has a C compiler (see `compiler`).

    Parameters
    ----------
    model : Model
        Model to export.
    name : str
        Name of the units, a lower-case C identifier.
    inverse : Inverse, optional
        Inverse of the same model, to export with it.

    Returns
    -------
    mapping of str to bytes
        Content by file name: NAME.fmu, and NAME_inverse.fmu with an inverse.

    Raises
    ------
    ModelError
        As for `c_program`; also if the name is that of a source file of every unit, or if the compiler fails.
    """
    if name == INTERFACE:
        raise ModelError(f"name: got {name!r}, which every unit contains; expected another name")
    program, digest = c_program(model, name, inverse), model_hash(model)
    further = tuple(CHANNELS[channel] for channel in prediction(model).channels)
    about = f"piezo stage, sample period {model.sample_period!r} s"
    runaway = RUNAWAY * model.displacement_scale
    parts = [CoSimulation(name, "", digest, f"Prediction of a {about}", (VOLTAGE, *further), DISPLACEMENT, runaway)]
    if inverse is not None:
        words = f"Inverse of a {about}: drive voltage for the displacement wanted {inverse.preview} samples later"
        turned = CoSimulation(
            f"{name}_inverse", "inverse_", f"{digest} inverse", words, (DISPLACEMENT,), VOLTAGE, math.inf
        )
        parts.append(turned)
    return {f"{part.identifier}.fmu": _packed(part, model, name, program) for part in parts}


def compiler() -> str | None:
    """Path of a C compiler on this computer: of the environment variable CC, or cc, gcc or clang; None without one."""
    return next(filter(None, (shutil.which(c) for c in (os.environ.get("CC"), "cc", "gcc", "clang") if c)), None)


def _packed(part: CoSimulation, model: Model, name: str, program: Mapping[str, str]) -> bytes:
    values = {"part": part, "model": model, "name": name, "units": UNITS}
    values |= {"version": __version__, "hash": model_hash(model)}

    def rendered(file: str) -> str:
        return templates().get_template(f"{file}.jinja").render(values)

    sources = {file: text for file, text in program.items() if file in (f"{name}.h", f"{name}.c")}
    sources[f"{INTERFACE}.c"] = rendered(f"{INTERFACE}.c")
    held: dict[str, str | bytes] = {"modelDescription.xml": rendered("modelDescription.xml")}
    held |= {f"sources/{file}": text for file, text in sources.items()}
    held["sources/buildDescription.xml"] = rendered("buildDescription.xml")
    held |= _library(part.identifier, sources)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in held.items():
            archive.writestr(zipfile.ZipInfo(file), content, zipfile.ZIP_DEFLATED)  # no date: same model, same bytes
    return packed.getvalue()


def _library(identifier: str, sources: Mapping[str, str]) -> dict[str, bytes]:
    """The compiled library by its path in the unit; empty without a compiler or on an unknown operating system."""
    program, system = compiler(), {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib")}.get(platform.system())
    if program is None or system is None:
        return {}
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    with tempfile.TemporaryDirectory() as folder:
        for file, text in sources.items():
            (Path(folder) / file).write_text(text, encoding="utf-8")
        files = sorted(file for file in sources if file.endswith(".c"))
        command = [program, *FLAGS, *files, "-lm", "-o", "library"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["no message"])[0]
            raise ModelError(f"{program}: cannot compile the unit ({reason}); name another compiler in CC")
        binary = (Path(folder) / "library").read_bytes()
    return {f"binaries/{machine}-{system[0]}/{identifier}{system[1]}": binary}
