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

"""Pick-up of the mains: a line at 50 or 60 Hz and its harmonics."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block
from ...blocks.time import TimeBlock
from ...c_form import CForm
from ...errors import ParameterError
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..invertibility import Invertibility


class MainsHum(Effect):
    """Sines at the mains frequency and its harmonics, with a different amplitude and phase in every record.

    Parameters
    ----------
    f : float
        Mains frequency [Hz].
    cosine, sine : sequence of float
        Amplitudes at f, 2f, 3f, … [m]; the same number of both.

    Notes
    -----
    t counts from the start of the record, or of the first in a series of continuing records, so that amplitude, phase
    and frequency of short records can be distinguished. In block-averaged records, the amplitudes are those after
    averaging.
    """

    name = "mains_hum"
    invertibility = Invertibility.NOT_NEEDED
    family = "disturbance"
    place = ChainPosition.ENVIRONMENT
    equation = "y = x + Σ_k [c_k cos(2π k f t) + s_k sin(2π k f t)]"
    signature = "The spectrum has a line that does not depend on the drive and is present at rest"
    source = "pick-up of the mains, 50 or 60 Hz and harmonics"
    parameters = (
        Parameter("f", "f", "Hz", 50.0, 10.0, 100.0, "mains frequency", "mains", scale=0.01),
        Parameter(
            "cosine",
            "c_k",
            "m",
            (0.0, 0.0, 0.0),
            -1e-5,
            1e-5,
            "cosine amplitudes",
            "Fourier",
            0.0,
            1e-9,
            per_record=True,
        ),
        Parameter(
            "sine", "s_k", "m", (0.0, 0.0, 0.0), -1e-5, 1e-5, "sine amplitudes", "Fourier", 0.0, 1e-9, per_record=True
        ),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        return tuple(cls(f=f) for f in extent.mains)

    def check(self) -> None:
        if self.array("cosine").size != self.array("sine").size:
            raise ParameterError(
                f"mains_hum: got {self.array('cosine').size} cosine and {self.array('sine').size} sine amplitudes, "
                "expected the same number of both"
            )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"mains_hum.{n}" for n in self.free_names())
        return MainsHumBlock(names, self["f"], self.array("cosine"), self.array("sine"), setting.sample_period)


def harmonics(frequency: float, count: int, t: Array) -> tuple[Array, Array]:
    """Cosines and sines of harmonics of `frequency` [Hz] at times t (n,) [s], both (count, n), by addition theorems."""
    cosines, sines = np.empty((count, t.size)), np.empty((count, t.size))
    angle = 2.0 * np.pi * frequency * t
    c, s = np.cos(angle), np.sin(angle)
    for k in range(count):
        cosines[k], sines[k] = c, s
        c, s = c * cosines[0] - s * sines[0], s * cosines[0] + c * sines[0]
    return cosines, sines


SUM = """\
const double c1 = cos(rate * t), s1 = sin(rate * t);
double c = c1, sine = s1, before;
int k;
for (k = 0; k < HARMONICS; k++) {
    x += c_k[k] * c + s_k[k] * sine;
    before = c;
    c = c * c1 - sine * s1;
    sine = sine * c1 + before * s1;
}
return x;
"""
"""C code of the sum of harmonics."""


class MainsHumBlock(TimeBlock):
    """x + Σ_k [c_k cos(2π k f t) + s_k sin(2π k f t)], t from the start of the first of continuing records."""

    from_rest = True

    def __init__(
        self, names: tuple[str, ...], frequency: float, cosine: Array, sine: Array, sample_period: float
    ) -> None:
        super().__init__(sample_period)
        self.names, self.cosine, self.sine = names, cosine, sine
        self.frequency = frequency

    def value(self, x: Array, t: Array) -> Array:
        if not (self.cosine.any() or self.sine.any()):
            return x
        for c, s, cosine, sine in zip(
            self.cosine, self.sine, *harmonics(self.frequency, self.cosine.size, t), strict=True
        ):
            x = x + (c * cosine + s * sine)
        return x

    def by_parameter(self, x: Array, t: Array) -> Array:
        cosines, sines = harmonics(self.frequency, self.cosine.size, t)
        by_frequency = np.zeros(t.size)
        for k, (c, s) in enumerate(zip(self.cosine, self.sine, strict=True)):
            by_frequency += 2.0 * np.pi * (k + 1) * t * (s * cosines[k] - c * sines[k])
        return np.vstack((by_frequency, cosines, sines))

    def c_form(self) -> CForm:
        if not self.cosine.size:
            return CForm("return x;")
        rate = 2.0 * np.pi * self.frequency
        return self.value_in_c(SUM, HARMONICS=self.cosine.size, rate=rate, c_k=self.cosine, s_k=self.sine)

    def inverted(self, name: str) -> None:
        return None
