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

"""The prediction of a model as a series of C forms, in the order of its chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..blocks.block import SumBlock
from ..c_form import CForm
from ..errors import ModelError
from ..model.model import Model


@dataclass(frozen=True, eq=False, slots=True)
class CChain:
    """C code from a drive voltage to a displacement, at the sample period of the model.

    Parameters
    ----------
    forms : mapping of str to CForm
        Forms by name, in chain order; the first takes volts, the last returns metres.
    channels : tuple of str
        Further measured inputs, in alphabetical order, which is the order of the arguments in C.
    """

    forms: dict[str, CForm]
    channels: tuple[str, ...]


def prediction(model: Model) -> CChain:
    """The chain of a model as C forms.

    Raises
    ------
    ModelError
        If an effect has no C form; the message names it.
    """
    chain, forms = model.at(model.sample_period), {}
    for label, block in zip(chain.labels, chain.blocks, strict=True):
        form = block.c_form()
        if isinstance(form, str):
            raise ModelError(f"{label}: {form}, so the model cannot be exported; expected a model without it")
        forms["hysteresis" if isinstance(block, SumBlock) else label] = form
    return CChain(forms, tuple(sorted({form.channel for form in forms.values() if form.channel})))


def rest_calls(prefix: str, forms: dict[str, CForm], state: str) -> Sequence[str]:
    """C calls that set every form to rest at x and then set x to the output of the form."""
    return [
        f"x = {prefix}_{name}_rest({f'&{state}->{name}, ' if form.has_state else ''}x);" for name, form in forms.items()
    ]


def step_calls(prefix: str, forms: dict[str, CForm], state: str) -> Sequence[str]:
    """C calls that process one sample."""
    calls = []
    for name, form in forms.items():
        arguments = [f"&{state}->{name}"] * form.has_state + ["x"] + [form.channel] * bool(form.channel)
        calls.append(f"x = {prefix}_{name}_step({', '.join(arguments)});")
    return calls


def units(names: Sequence[str]) -> dict[str, str]:
    """Units of input and output of every form of a chain, as text by name."""
    at = [names.index(scale) for scale in ("voltage_scale", "displacement_scale")]
    normalised = "normalised [1]"
    found = {}
    for k, name in enumerate(names):
        unit, after = ("V" if k <= at[0] else normalised if k <= at[1] else "m" for k in (k, k + 1))
        found[name] = f"{unit} in, {after} out"
    return found
