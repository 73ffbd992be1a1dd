"""Pick-up of the mains: a line at 50 or 60 Hz and its harmonics."""

from __future__ import annotations

import numpy as np

from ..errors import ParameterError
from ..parameter import Parameter
from .block import Array, Block, State
from .effect import Effect, Place, Setting
from .time_block import TimeBlock


class MainsHum(Effect):
    """Sines at the mains frequency and its harmonics, with their own amplitude and phase in every record.

    Parameters
    ----------
    f : float
        Mains frequency [Hz].
    cosine, sine : sequence of float
        Amplitudes at f, 2f, 3f, … [m]; equally many.

    Notes
    -----
    t counts from the start of the record, or of the first of those that continue one another, so that amplitude, phase
    and frequency of short records can be told apart. In block-averaged records they are those after averaging.
    """

    name = "mains_hum"
    family = "disturbance"
    place = Place.ENVIRONMENT
    equation = "y = x + Σ_k [c_k cos(2π k f t) + s_k sin(2π k f t)]"
    signature = "a line that is unrelated to the drive and present at rest"
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

    def check(self) -> None:
        if self.array("cosine").size != self.array("sine").size:
            raise ParameterError(
                f"mains_hum: got {self.array('cosine').size} cosine and {self.array('sine').size} sine amplitudes, "
                "expected equally many"
            )

    def block(self, setting: Setting, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"mains_hum.{n}" for n in self.free_names())
        return MainsHumBlock(names, self["f"], self.array("cosine"), self.array("sine"), setting.sample_period)


class MainsHumBlock(TimeBlock):
    """x + Σ_k [c_k cos(2π k f t) + s_k sin(2π k f t)], t from the start of the record."""

    def __init__(
        self, names: tuple[str, ...], frequency: float, cosine: Array, sine: Array, sample_period: float
    ) -> None:
        super().__init__(sample_period)
        self.names, self.cosine, self.sine = names, cosine, sine
        self.rates = 2.0 * np.pi * np.arange(1, cosine.size + 1)
        self.frequency = frequency

    def rest(self, x0: float, time: float) -> State:
        return 0.0, 0

    def value(self, x: Array, t: Array) -> Array:
        for rate, c, s in zip(self.rates, self.cosine, self.sine, strict=True):
            angle = rate * self.frequency * t
            x = x + (c * np.cos(angle) + s * np.sin(angle))
        return x

    def by_parameter(self, x: Array, t: Array) -> Array:
        angles = np.outer(self.rates * self.frequency, t)
        cosines, sines = np.cos(angles), np.sin(angles)
        by_angle = self.sine[:, None] * cosines - self.cosine[:, None] * sines
        return np.vstack(((self.rates @ by_angle) * t, cosines, sines))
