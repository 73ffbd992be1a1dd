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

"""Commands of the data recorder of an emulated controller."""

from __future__ import annotations

from collections.abc import Mapping

from ...stage.gcs2.error_number import ILLEGAL_AXIS
from .answer import array, items
from .arguments import AXIS, Command, groups, positive, tables
from .motion import Motion
from .recorder import OPTIONS, Recorder
from .refusal import Refusal


class RecorderCommands:
    """The commands of a data recorder: settings and queries.

    Parameters
    ----------
    recorder : Recorder
        The data recorder.
    motion : Motion
        The motion that it records.
    """

    def __init__(self, recorder: Recorder, motion: Motion) -> None:
        self._recorder, self._motion = recorder, motion
        self._trigger = dict.fromkeys(recorder.numbers, "0 0")

    @property
    def by_name(self) -> Mapping[str, Command]:
        """The commands by mnemonic."""
        recorder = self._recorder
        return {
            "DRC": self._drc,
            "DRC?": lambda a: items({t: f"{self._source(t)} {recorder.option(t)}" for t in self._tables(a)}),
            "DRL?": lambda a: items(dict.fromkeys(self._tables(a), recorder.recorded)),
            "DRR?": self._drr,
            "DRT": self._drt,
            "DRT?": lambda a: items({t: self._trigger[t] for t in self._tables(a)}),
            "HDR?": lambda _: ["#RecordOptions", *(f"{n}={words}" for n, words in OPTIONS.items()), "end of help"],
            "RTR": self._rtr,
            "RTR?": lambda _: [str(recorder.rate)],
            "TNR?": lambda _: [str(len(recorder.numbers))],
            "WGR": lambda _: recorder.start(0),
        }

    def _drc(self, arguments: list[str]) -> None:
        for table, source, option in groups(arguments, 3):
            if source not in ("0", AXIS):
                raise Refusal(ILLEGAL_AXIS)
            self._recorder.configure(int(table), int(option))

    def _drr(self, arguments: list[str]) -> list[str]:
        recorder = self._recorder
        first, count = (int(a) for a in arguments[:2]) if arguments else (1, recorder.recorded)
        chosen = self._tables(arguments[2:])
        names = [f"{OPTIONS[recorder.option(t)]}{self._source(t)}" for t in chosen]
        return array(recorder.read(first, count, chosen), self._motion.cycle * recorder.rate, names)

    def _drt(self, arguments: list[str]) -> None:
        for table, source, value in groups(arguments, 3):
            for each in self._recorder.numbers if table == "0" else self._tables([table]):
                self._trigger[each] = f"{int(source)} {value}"

    def _rtr(self, arguments: list[str]) -> None:
        self._recorder.rate = positive(arguments[0])

    def _tables(self, arguments: list[str]) -> list[int]:
        return tables(arguments, self._recorder.numbers)

    def _source(self, table: int) -> str:
        return AXIS if self._recorder.option(table) else "0"
