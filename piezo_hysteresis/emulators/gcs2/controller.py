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

"""`Controller`: an emulated one-axis GCS 2.0 piezo controller with a simulated stage."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...errors import StageError
from ...stage.description import Samples
from ...stage.gcs2.error_number import (
    GENERATOR_ACTIVE,
    READ_ONLY,
    SERVO_IS_ON,
    STOPPED_BY_COMMAND,
    SYNTAX,
    UNKNOWN_COMMAND,
    UNKNOWN_PARAMETER,
    VOLTAGE_OUT_OF_LIMITS,
)
from ...stage.simulated import SimulatedStage
from ..fault import Fault, Faults
from .answer import items
from .arguments import AXIS, Command, axes, groups, of_axis, of_channel
from .motion import Motion
from .recorder import Recorder
from .recorder_commands import RecorderCommands
from .refusal import Refusal
from .wave import WaveGenerator
from .wave_commands import WaveCommands

SERVO_TIME, RECORDER_POINTS = 0x0E000200, 0x16000200
"""Numbers of controller parameters: servo update time [s], points of the data recorder."""
STOP, MOVING, READY, RUNNING = "\x18", "\x05", "\x07", "\x09"
"""Commands of a single byte: stop everything; does the axis move, is it ready, does the generator run."""
BYTES = {STOP: "#24", MOVING: "#5", READY: "#7", RUNNING: "#9"}
"""Commands of a single byte, with their names in the answer to ``HLP?``."""

_TABLES, _POINTS, _WAVE_TABLES = 8, 262144, 4
"""Number of tables of the data recorder, total number of their points, and number of wave tables."""


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer to a command.

    Parameters
    ----------
    lines : list of str, optional
        Lines of the answer; None if the command has no answer.
    struck : dict
        Single faults that occur at this command, with their values; the server applies them to the answer.
    """

    lines: list[str] | None
    struck: dict[str, float]


class Controller:
    """Carries out GCS 2.0 commands in open loop. With the servo on, it only refuses open-loop motion.

    Parameters
    ----------
    stage : SimulatedStage
        Its sample period is the servo time. Its limits times the amplifier gain are the limits of the piezo voltage.
    serial : str
        Serial number in ``*IDN?``.
    command_per_volt : float
        Open-loop command divided by piezo voltage [1/V].
    recorder_points : int
        Number of samples that all recorder tables together can store.
    faults : iterable of Fault
        Faults that occur.
    speed : float
        Simulated seconds per second of the computer; infinite to play every waveform at once.
    """

    def __init__(
        self,
        stage: SimulatedStage,
        *,
        serial: str = "0",
        command_per_volt: float = 1.0,
        recorder_points: int = _POINTS,
        faults: Iterable[Fault] = (),
        speed: float = 1.0,
    ) -> None:
        self.faults, self._serial = Faults(faults), serial
        gain = stage.description.amplifier_gain
        self._command_gain = gain * command_per_volt
        self._low, self._high = stage.description.voltage_min * gain, stage.description.voltage_max * gain
        limits = sorted((self._low * command_per_volt, self._high * command_per_volt))
        self._recorder = Recorder(_TABLES, recorder_points, self._command_gain, self.faults)
        self._wave = WaveGenerator(_WAVE_TABLES, recorder_points // _TABLES, limits[0], limits[1])
        self._motion = Motion(stage, self._recorder, self.faults, speed)
        self._servo, self._error = 0, 0
        self._commands = self._known()

    def carry_out(self, line: str) -> Reply:
        """Carry out one command.

        Parameters
        ----------
        line : str
            A line without its line feed, or a single byte.

        Returns
        -------
        Reply
        """
        words = [BYTES[line]] if line in BYTES else line.split()
        if not words:
            return Reply(None, {})
        name, arguments = words[0].upper(), words[1:]
        struck = self.faults.count(name)
        if self.faults.lasts("servo_on"):
            self._servo = 1
        self._motion.advance()
        if "error" in struck:
            self._error = int(struck["error"])
            return Reply(None, struck)
        if name == "ERR?":
            self._error, number = 0, self._error
            return Reply([str(number)], struck)
        try:
            if name not in self._commands:
                raise Refusal(UNKNOWN_COMMAND)
            return Reply(self._commands[name](arguments), struck)
        except Refusal as refusal:
            self._error = refusal.number
        except (ValueError, IndexError):
            self._error = SYNTAX
        return Reply(None, struck)

    def _known(self) -> dict[str, Command]:
        motion = self._motion
        lowest, highest = 0.0, float(motion.stage.parameters.full_stroke) * 1e6
        return {
            "#5": lambda _: [f"{int(motion.is_playing):x}"],
            "#7": lambda _: ["\xb1"],
            "#9": lambda _: [f"0x{int(motion.is_playing):x}"],
            "#24": lambda _: self._stop(),
            "*IDN?": lambda _: [f"piezo_hysteresis, E-727.EMULATED, {self._serial}, 1.0"],
            "CSV?": lambda _: ["2.0"],
            "HLP?": lambda _: ["The following commands are valid:", *sorted([*self._commands, "ERR?"]), "end of help"],
            "HPA?": lambda _: [
                f"0x{SERVO_TIME:08X}=\t0\t1\tFLOAT\temulated\tServo Update Time",
                f"0x{RECORDER_POINTS:08X}=\t0\t1\tINT\temulated\tMax Number Of Data Recorder Points",
            ],
            "OVF?": of_axis(lambda: 0),
            "POS?": of_axis(lambda: motion.position * 1e6),
            "PUN?": of_axis(lambda: "um"),
            "SAI?": lambda _: [AXIS],
            "SPA": self._write_parameter,
            "SPA?": self._spa,
            "SVA": self._sva,
            "SVA?": of_axis(lambda: motion.command * self._command_gain),
            "SVO": self._svo,
            "SVO?": of_axis(lambda: self._servo),
            "TMN?": of_axis(lambda: lowest),
            "TMX?": of_axis(lambda: highest),
            "VMA?": of_channel(lambda: self._high),
            "VMI?": of_channel(lambda: self._low),
            "VOL?": of_channel(lambda: motion.voltage),
            **RecorderCommands(self._recorder, motion).by_name,
            **WaveCommands(self._wave, motion, self._start).by_name,
        }

    def _stop(self) -> None:
        self._motion.stop()
        self._wave.mode = 0
        raise Refusal(STOPPED_BY_COMMAND)

    def _svo(self, arguments: list[str]) -> None:
        for axis, state in groups(arguments, 2):
            axes([axis])
            self._servo = 1 if self.faults.lasts("servo_on") else int(bool(int(state)))

    def _sva(self, arguments: list[str]) -> None:
        for axis, value in groups(arguments, 2):
            axes([axis])
            if self._servo:
                raise Refusal(SERVO_IS_ON)
            if self._motion.is_playing:
                raise Refusal(GENERATOR_ACTIVE)
            drive = float(value) / self._command_gain
            if not self._allowed(np.array([drive])):
                raise Refusal(VOLTAGE_OUT_OF_LIMITS)
            self._motion.set(drive)

    def _start(self) -> None:
        if self._servo and not self.faults.lasts("servo_on"):
            raise Refusal(SERVO_IS_ON)
        drive = self._wave.waveform() / self._command_gain
        if not self._allowed(drive):
            raise Refusal(VOLTAGE_OUT_OF_LIMITS)
        self._recorder.start(drive.size)
        self._motion.play(drive)

    def _allowed(self, drive: Samples) -> bool:
        try:
            self._motion.stage.description.check_voltage(drive, self._motion.command, self._motion.servo_time)
        except StageError:
            return False
        return True

    def _write_parameter(self, arguments: list[str]) -> None:
        raise Refusal(READ_ONLY)

    def _spa(self, arguments: list[str]) -> list[str]:
        stored = {SERVO_TIME: self._motion.servo_time, RECORDER_POINTS: self._recorder.points}
        wanted = groups(arguments, 2) if arguments else [[AXIS, hex(number)] for number in stored]
        lines = []
        for item, parameter in wanted:
            axes([item])
            if int(parameter, 0) not in stored:
                raise Refusal(UNKNOWN_PARAMETER)
            lines += items({f"{item} 0x{int(parameter, 0):X}": stored[int(parameter, 0)]})
        return lines
