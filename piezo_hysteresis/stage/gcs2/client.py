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

"""`Client`: commands and questions in GCS 2.0 syntax, with the error of the controller read after every one."""

from __future__ import annotations

import math
import re

from .array_answer import ArrayAnswer
from .connection import Connection, Gcs2Error, NoAnswerError
from .error_number import STOPPED_BY_COMMAND, meaning

_STOP, _RUNNING = "\x18", "\x09"
"""Single-byte commands: stop everything, is the generator running."""
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""A number of an answer."""
_ERROR_NUMBER = re.compile(r"-?[0-9]{1,6}")
"""An answer to ``ERR?``."""
_MASK = re.compile(r"(0[xX])?[0-9a-fA-F]{1,8}")
"""An answer to ``#9``."""
LARGEST_COUNT = 1e9
"""Largest number of samples, points or tables of any controller."""


class Client:
    """GCS 2.0 over a `Connection`.

    Parameters
    ----------
    connection : Connection
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection

    def command(self, text: str) -> None:
        """Send a command and read its error.

        Raises
        ------
        Gcs2Error
            If the controller refuses it or the link fails.
        """
        self._send(f"{text}\nERR?\n")
        self._check(text, self._error(text))

    def ask(self, text: str) -> list[str]:
        """Lines of the answer to a question.

        Raises
        ------
        Gcs2Error
            If the controller refuses it, does not answer, or the link fails.
        """
        self._send(f"{text}\n")
        try:
            lines = self.connection.receive()
        except NoAnswerError as error:
            raise self._unanswered(text, error) from None
        self.connection.send("ERR?\n")
        self._check(text, self._error(text))
        return lines

    def value(self, text: str) -> str:
        """The one value of an answer ``item=value`` or ``value``."""
        lines = self.ask(text)
        if len(lines) != 1:
            raise self.invalid_answer(text, " ".join(lines), "one line")
        return lines[0].rpartition("=")[2].strip()

    def number(self, text: str, lowest: float = -math.inf, highest: float = math.inf) -> float:
        """The one value of an answer as a finite number from `lowest` to `highest`; Gcs2Error for any other value."""
        words = self.value(text)
        if not _NUMBER.fullmatch(words):
            raise self.invalid_answer(text, words, "a number")
        number = float(words)
        if not math.isfinite(number):
            raise self.invalid_answer(text, words, "a finite number")
        if not lowest <= number <= highest:
            raise self.invalid_answer(text, words, f"a number from {lowest:g} to {highest:g}")
        return number

    def whole(self, text: str) -> int:
        """The one value of an answer, as a whole number that can be a count."""
        number = self.number(text, 0, LARGEST_COUNT)
        if number != int(number):
            raise self.invalid_answer(text, f"{number:g}", "a whole number")
        return int(number)

    def array(self, text: str, rows: int, columns: int) -> ArrayAnswer:
        """The answer to a question for recorded or stored samples."""
        lines = self.ask(text)
        try:
            return ArrayAnswer.parse(lines, rows, columns)
        except Gcs2Error as error:
            raise Gcs2Error(f"{self.connection.place}: answer to '{text}': {error}") from None

    def generators_running(self) -> int:
        """Bit mask of the wave generators that run."""
        self._send(_RUNNING)
        try:
            words = " ".join(self.connection.receive())
        except NoAnswerError as error:
            raise self._unanswered("#9", error) from None
        if not _MASK.fullmatch(words):
            raise self.invalid_answer("#9", words, "a hexadecimal number")
        return int(words, 16)

    def stop(self) -> None:
        """Stop all motion at once.

        The controller then reports error 10 ("stopped by command"), which is read and ignored.
        """
        self._send(f"{_STOP}ERR?\n")
        number = self._error("#24")
        if number != STOPPED_BY_COMMAND:
            self._check("#24", number)

    def invalid_answer(self, text: str, got: str, expected: str) -> Gcs2Error:
        """Error for an impossible answer. The link is closed, because further answers cannot be trusted."""
        self.connection.close()
        return Gcs2Error(f"{self.connection.place}: got '{got[:60]}' to '{text}', expected {expected}")

    def _send(self, text: str) -> None:
        """Send over a link on which no error of an earlier command waits."""
        if not self.connection.is_open:
            self.connection.send("ERR?\n")
            self._error("connecting")
        self.connection.send(text)

    def _error(self, text: str) -> int:
        try:
            words = " ".join(self.connection.receive())
        except NoAnswerError as error:
            self.connection.close()
            raise Gcs2Error(f"{error} to ERR? after '{_short(text)}'") from None
        if not _ERROR_NUMBER.fullmatch(words):
            raise self.invalid_answer("ERR?", words, "an error number")
        return int(words)

    def _check(self, text: str, number: int) -> None:
        if number:
            raise Gcs2Error(f"{self.connection.place}: refused '{_short(text)}' with {meaning(number)}")

    def _unanswered(self, text: str, error: NoAnswerError) -> Gcs2Error:
        """Error for a missing answer, which is how a controller refuses a query. The link is closed."""
        words = f"{error} to '{_short(text)}'"
        try:
            self.connection.send("ERR?\n")
            number = int(" ".join(self.connection.receive()))
            words += f"; it holds {meaning(number)}" if number else ""
        except (Gcs2Error, ValueError):
            pass
        self.connection.close()
        return Gcs2Error(words)


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."
