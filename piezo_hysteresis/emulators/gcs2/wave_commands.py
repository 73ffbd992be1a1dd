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

"""Commands of the wave generator of an emulated controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ...stage.gcs2.error_number import GENERATOR_ACTIVE, OUT_OF_RANGE
from .answer import array, items
from .arguments import Command, channels, groups, of_channel, positive
from .motion import Motion
from .refusal import Refusal
from .wave import WaveGenerator


class WaveCommands:
    """The commands of a wave generator: settings and queries.

    Parameters
    ----------
    wave : WaveGenerator
        The wave generator.
    motion : Motion
        The motion that it drives.
    start : callable
        Starts generator and recorder, or raises `Refusal`.
    """

    def __init__(self, wave: WaveGenerator, motion: Motion, start: Callable[[], None]) -> None:
        self._wave, self._motion, self._start = wave, motion, start

    @property
    def by_name(self) -> Mapping[str, Command]:
        """The commands by mnemonic."""
        wave = self._wave
        return {
            "GWD?": self._gwd,
            "WAV": wave.write,
            "WAV?": lambda a: [f"{a[0]} {a[1]}={len(wave.points(int(a[0])))}"],
            "WCL": self._wcl,
            "WGC": lambda a: self._set("cycles", a[0], int(a[1])),
            "WGC?": of_channel(lambda: wave.cycles),
            "WGO": self._wgo,
            "WGO?": of_channel(lambda: wave.mode),
            "WMS?": lambda a: items(dict.fromkeys(map(int, a or wave.numbers), wave.longest)),
            "WOS": lambda a: self._set("offset", a[0], float(a[1])),
            "WOS?": of_channel(lambda: wave.offset),
            "WSL": lambda a: self._set("table", a[0], int(a[1])),
            "WSL?": of_channel(lambda: wave.table),
            "WTR": lambda a: self._set("rate", a[0], positive(a[1])),
            "WTR?": of_channel(lambda: f"{wave.rate} 0"),
        }

    def _wcl(self, arguments: list[str]) -> None:
        for table in arguments:
            self._wave.clear(int(table))

    def _wgo(self, arguments: list[str]) -> None:
        for channel, mode in groups(arguments, 2):
            channels([channel])
            if int(mode) not in (0, 1):
                raise Refusal(OUT_OF_RANGE)
            if int(mode):
                self._start()
            else:
                self._motion.stop()
            self._wave.mode = int(mode)

    def _set(self, setting: str, channel: str, value: float) -> None:
        channels([channel])
        if self._motion.is_playing:
            raise Refusal(GENERATOR_ACTIVE)
        if setting == "table" and value:
            self._wave.points(int(value))
        setattr(self._wave, setting, value)

    def _gwd(self, arguments: list[str]) -> list[str]:
        first, count, table = (int(a) for a in arguments)
        points = self._wave.points(table)[first - 1 : first - 1 + count]
        if first < 1 or len(points) != count:
            raise Refusal(OUT_OF_RANGE)
        return array(np.array(points)[:, None], self._motion.servo_time * self._wave.rate, [f"Wave Table {table}"])
