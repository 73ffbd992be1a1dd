"""`Client`: commands and questions in GCS 2.0 syntax, with the error of the controller read after every one."""

from __future__ import annotations

from .array import GcsArray
from .connection import Connection, Gcs2Error, NoAnswerError
from .error_number import STOPPED_BY_COMMAND, meaning

_STOP, _RUNNING = "\x18", "\x09"
"""Single-byte commands: stop everything, is the generator running."""


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
            raise self.nonsense(text, " ".join(lines), "one line")
        return lines[0].rpartition("=")[2].strip()

    def number(self, text: str) -> float:
        """The one value of an answer, as a finite number."""
        words = self.value(text)
        try:
            number = float(words)
        except ValueError:
            raise self.nonsense(text, words, "a number") from None
        if not abs(number) < float("inf"):
            raise self.nonsense(text, words, "a finite number")
        return number

    def whole(self, text: str) -> int:
        """The one value of an answer, as a whole number."""
        number = self.number(text)
        if number != int(number):
            raise self.nonsense(text, f"{number:g}", "a whole number")
        return int(number)

    def array(self, text: str, rows: int, columns: int) -> GcsArray:
        """The answer to a question for recorded or stored samples."""
        lines = self.ask(text)
        try:
            return GcsArray.parse(lines, rows, columns)
        except Gcs2Error as error:
            raise Gcs2Error(f"{self.connection.place}: answer to '{text}': {error}") from None

    def generators_running(self) -> int:
        """Bit mask of the wave generators that run."""
        self._send(_RUNNING)
        try:
            words = " ".join(self.connection.receive())
        except NoAnswerError as error:
            raise self._unanswered("#9", error) from None
        try:
            mask = int(words, 16)
        except ValueError:
            mask = -1
        if mask < 0:
            raise self.nonsense("#9", words, "a hexadecimal number")
        return mask

    def stop(self) -> None:
        """Stop all motion at once; the error that tells so is read and forgotten."""
        self._send(f"{_STOP}ERR?\n")
        number = self._error("#24")
        if number != STOPPED_BY_COMMAND:
            self._check("#24", number)

    def nonsense(self, text: str, got: str, expected: str) -> Gcs2Error:
        """The error for an answer that cannot be; what comes next cannot be trusted, so the link is closed."""
        self.connection.close()
        return Gcs2Error(f"{self.connection.place}: got '{got[:60]}' to '{text}', expected {expected}")

    def _send(self, text: str) -> None:
        """Send over a link on which no error of an earlier one waits."""
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
        try:
            return int(words)
        except ValueError:
            raise self.nonsense("ERR?", words, "an error number") from None

    def _check(self, text: str, number: int) -> None:
        if number:
            raise Gcs2Error(f"{self.connection.place}: refused '{_short(text)}' with {meaning(number)}")

    def _unanswered(self, text: str, error: NoAnswerError) -> Gcs2Error:
        """A controller is silent to what it refuses; the link may be out of step afterwards and is closed."""
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
