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

"""The inverse of a model as a series of C forms, from the wanted displacement to the drive voltage."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..c_form import CForm
from ..compensation import Inverse
from ..errors import ModelError
from .prediction import step_calls


@dataclass(frozen=True, eq=False, slots=True)
class CInverse:
    """C code from a wanted displacement to a drive voltage.

    Parameters
    ----------
    forms : dict of str to CForm
        Forms by name, in the order of the inverse; the first takes metres, the last returns volts.
    stages : dict of str to (int or None)
        Number of the block that each form inverts; None for a form whose input at rest is the displacement.
    preview : int
        Number of samples of the wanted displacement that must be known in advance.
    """

    forms: dict[str, CForm]
    stages: dict[str, int | None]
    preview: int

    def rest_calls(self, prefix: str, chain: dict[str, CForm]) -> Iterator[str]:
        """C calls that set every stage to rest, each after the call of the prediction that computes its x at rest."""
        waiting = {at: name for name, at in self.stages.items() if self.forms[name].has_state}
        for k, (name, form) in enumerate(chain.items()):
            if k in waiting:
                yield f"{prefix}_{waiting[k]}_rest(&state->{waiting[k]}, x);"
            yield f"x = {prefix}_{name}_rest({f'&stage.{name}, ' if form.has_state else ''}x);"
        if None in waiting:
            yield f"{prefix}_{waiting[None]}_rest(&state->{waiting[None]}, x);"

    def step_calls(self, prefix: str) -> list[str]:
        """C calls that process one sample."""
        return list(step_calls(prefix, self.forms, "state"))


def inversion(inverse: Inverse) -> CInverse:
    """The stages of an inverse as C forms.

    Raises
    ------
    ModelError
        If a stage has no C form; the message names it.
    """
    forms, stages = {}, {}
    for label, (at, form) in inverse.c_forms().items():
        if isinstance(form, str):
            raise ModelError(f"{label}: {form}, so the inverse cannot be exported")
        forms[f"inverse_{label}"], stages[f"inverse_{label}"] = form, at
    return CInverse(forms, stages, inverse.preview)
