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

"""`c_program`: writes a model as a C program: header, source and self-test."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined

from .. import __version__
from ..compensation import Inverse
from ..errors import ModelError
from ..model.chain import RUNAWAY
from ..model.model import Model
from ..model.model_parameters import PREFIX, to_parameters
from . import c_text
from .inversion import inversion
from .prediction import prediction, rest_calls, step_calls, units
from .vectors import rounding, vectors

NAME = re.compile(r"[a-z][a-z0-9_]{0,40}")
"""Valid names of a program; every file, type and function begins with the name."""


@cache
def templates() -> Environment:
    """Jinja environment with the templates of the files."""
    environment = Environment(
        loader=PackageLoader("piezo_hysteresis.export"), undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters |= {"number": c_text.number, "array": c_text.array, "comment": _comment}
    return environment


def c_program(model: Model, name: str = "piezo", inverse: Inverse | None = None) -> Mapping[str, str]:
    """Write a model as a C program.

    Parameters
    ----------
    model : Model
        Model to export, at its sample period.
    name : str
        Beginning of the names of all files, functions and types.
    inverse : Inverse, optional
        Inverse of the same model, to export with it.

    Returns
    -------
    mapping of str to str
        Text by file name: NAME.h, NAME.c and NAME_test.c.

    Raises
    ------
    ModelError
        If the name is not a lower-case C identifier or is that of a header of C, an effect has no C form, or the
        inverse is that of another model.
    """
    if not NAME.fullmatch(name):
        raise ModelError(f"name: got {name!r}, expected lower-case letters, digits and '_', a letter first")
    if name in _library_headers():
        raise ModelError(f"name: got {name!r}, expected no header of C: {name}.h would hide it")
    if inverse is not None and model_hash(inverse.model) != model_hash(model):
        raise ModelError("inverse: got that of another model, expected that of the model to export")
    found = prediction(model)
    values = {
        "name": name,
        "model": model,
        "version": __version__,
        "hash": model_hash(model),
        "channels": found.channels,
        "limit": RUNAWAY * model.displacement_scale,
        "has_state": [n for n, form in found.forms.items() if form.has_state],
        "structures": [s for n, form in found.forms.items() for s in c_text.structures(name, n, form)],
        "library": c_text.library(found.forms),
        "functions": {n: "\n".join(c_text.functions(name, n, form)) for n, form in found.forms.items()},
        "units": units(tuple(found.forms)),
        "rest_calls": rest_calls(name, found.forms, "state"),
        "step_calls": step_calls(name, found.forms, "state"),
        "vectors": vectors(model, inverse),
        "rounding": rounding(found.forms.values()),
        "inverse": None,
    }
    if inverse is not None:
        turned = inversion(inverse)
        values["inverse"] = {
            "exact": inverse.is_exact,
            "limits": inverse.limits,
            "preview": turned.preview,
            "rounding": rounding(turned.forms.values()),
            "structures": [s for n, form in turned.forms.items() for s in c_text.structures(name, n, form)],
            "has_state": [n for n, form in turned.forms.items() if form.has_state],
            "functions": {
                n: "\n".join(c_text.functions(name, n, form, always_rest=False)) for n, form in turned.forms.items()
            },
            "rest_calls": list(turned.rest_calls(name, found.forms)),
            "step_calls": turned.step_calls(name),
        }
        values["library"] = c_text.library({**found.forms, **turned.forms})
    files = {f"{name}.h": "header.h.jinja", f"{name}.c": "source.c.jinja", f"{name}_test.c": "self_test.c.jinja"}
    return {file: templates().get_template(source).render(values) for file, source in files.items()}


def _library_headers() -> set[str]:
    """Headers of the C library that the files include."""
    here = templates()
    sources = (here.loader.get_source(here, file)[0] for file in here.list_templates() if here.loader is not None)
    return {header for source in sources for header in re.findall(r"#include <(\w+)\.h>", source)}


def model_hash(model: Model) -> str:
    """Hash of the model as in the model file; validity and provenance do not influence it."""
    return str(to_parameters(model)[f"{PREFIX}hash"])


def _comment(text: str) -> str:
    """Text in which nothing ends a C comment."""
    return text.replace("*/", "* /")
