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

"""`HeldDeviation`: the place of a block without inverse in the inverse of a chain."""

from __future__ import annotations

import numpy as np

from ...c_form import CForm
from ..block import Block
from .inverted_block import Array, InvertedBlock, State


class HeldDeviation(InvertedBlock):
    """Subtracts the deviation of a block at the start, y - x, as if it stayed constant.

    So the drive continues from the present voltage. Its error is the change of the deviation since the start.

    Parameters
    ----------
    block : Block
        A block that adds a small deviation to its input and has no inverse.
    """

    is_exact = False

    def __init__(self, block: Block) -> None:
        self._block = block

    def start(self, x0: float, state: State, ahead: int) -> State:
        y, _ = self._block.run(np.array([x0]), state)
        return float(y[0]) - x0

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y - state, state

    def c_form(self, ahead: int) -> CForm | str:
        left_out = self._block.c_form()
        if isinstance(left_out, str):
            return left_out
        settle = f"{left_out.call('rest', 'left_out', 'x')};\n" if left_out.has_state else ""
        rest = f"{settle}s->deviation = {left_out.call('step', 'left_out', 'x')} - x;\nreturn x;"
        return CForm("return x - s->deviation;", rest, state=("double deviation",), parts={"left_out": left_out})
