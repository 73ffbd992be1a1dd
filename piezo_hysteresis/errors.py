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

"""The error classes. A message says what was got, what was expected and what to do.

::

    PiezoError
    ├── ParameterError        (ValueError)       a value outside its bounds, an unknown name
    ├── RecordError           (ValueError)       samples that are no record of a stage
    ├── ModelError            (ValueError)       a chain or a model file that makes no sense
    ├── IdentificationError   (RuntimeError)     data that do not determine what was asked
    ├── DivergenceError       (ArithmeticError)  a simulation that ran away
    ├── StageError            (OSError)          a stage or its limits, link, state
    │   ├── DeviceError                          the device itself failed
    │   └── StoppedError                         work on a device was broken off because a stop was asked for
    └── RecordingError        (OSError)          a file that cannot be read or written

`UnknownStateWarning` is the one warning: a simulation that starts from rest although its record does not.
"""

from __future__ import annotations


def printable(text: str) -> str:
    r"""One line that any terminal shows as it is: what cannot be printed stands as its escape.

    Control characters, line breaks, and marks that change the direction of writing are escaped: text from a message, a
    file or a device can neither forge a line of a log nor steer a terminal.

    Examples
    --------
    >>> print(printable("E-727\n[ERROR] forged"))
    E-727\n[ERROR] forged
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text)


def reason_of(error: BaseException) -> str:
    """An exception in one line: what a PiezoError says, or what fault of this program it is."""
    return str(error) if isinstance(error, PiezoError) else printable(f"fault of this program: {error!r}")


class PiezoError(Exception):
    """Whatever this package raises on purpose; one line that a user can act on, whatever text of others is in it."""

    def __str__(self) -> str:
        return printable(super().__str__())


class ParameterError(PiezoError, ValueError):
    """A parameter value, name or unit that is not acceptable."""


class RecordError(PiezoError, ValueError):
    """Samples, periods or labels that do not form a record."""


class ModelError(PiezoError, ValueError):
    """An inconsistent model or model file."""


class IdentificationError(PiezoError, RuntimeError):
    """The data do not determine the requested result."""


class StageError(PiezoError, OSError):
    """A stage refused, failed, or was asked to leave its limits."""


class DeviceError(StageError):
    """The device refused, answered nonsense, or its link failed: a fault of the device, not of its user."""


class StoppedError(StageError):
    """Work on a device was broken off because a stop was asked for; nothing was started after that."""


class RecordingError(PiezoError, OSError):
    """A recording that cannot be read or written."""


class DivergenceError(PiezoError, ArithmeticError):
    """A simulation left every physical range.

    Parameters
    ----------
    effect : str
        Identifier of the effect whose output ran away.
    sample : int
        Index of the first non-finite or runaway sample in the block.
    time : float
        Time of that sample since the start of the block [s].
    """

    def __init__(self, effect: str, sample: int, time: float) -> None:
        super().__init__(
            f"simulation diverged in '{effect}' at sample {sample} ({time:.6g} s): "
            "expected a bounded output; check its parameters (stable ARX, beta >= |gamma|) and the drive"
        )
        self.effect, self.sample, self.time = effect, sample, time


class UnknownStateWarning(UserWarning):
    """A simulation that starts from rest although the record does not."""
