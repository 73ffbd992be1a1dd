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

"""The error classes. A message states what was got, what was expected and what to do.

::

    PiezoError
    ├── ParameterError        (ValueError)       a value outside its bounds, an unknown name
    ├── RecordError           (ValueError)       samples that do not form a record
    ├── ModelError            (ValueError)       an inconsistent chain or model file
    ├── IdentificationError   (RuntimeError)     data that do not determine the requested result
    ├── DivergenceError       (ArithmeticError)  a simulation that diverged
    ├── StageError            (OSError)          a stage or its limits, link, state
    │   ├── DeviceError                          the device itself failed
    │   ├── StoppedError                         work on a device was interrupted by a stop
    │   └── UnknownVoltageError                  nothing reports the voltage at which a device stands
    ├── RecordingError        (OSError)          a file that cannot be read or written
    └── MissingPackageError   (ImportError)      a Python package of an extra is not installed

`UnknownStateWarning` is the only warning: a simulation starts from rest although its record does not.
"""

from __future__ import annotations


def printable(text: str) -> str:
    r"""Text as one line without control characters, which are replaced by escape sequences.

    Control characters, line breaks, and marks that change the direction of writing are escaped, so that text from a
    message, a file or a device can neither forge a line of a log nor control a terminal.

    Examples
    --------
    >>> print(printable("E-727\n[ERROR] forged"))
    E-727\n[ERROR] forged
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text)


def counted(number: int, noun: str) -> str:
    """A number of things as text.

    >>> counted(1, "complete phase"), counted(2, "phase")
    ('1 complete phase', '2 phases')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def reason_of(error: BaseException) -> str:
    """An exception in one line: the message of a PiezoError, or a fault of this program."""
    return str(error) if isinstance(error, PiezoError) else printable(f"fault of this program: {error!r}")


class PiezoError(Exception):
    """Base class of the errors of this package; the message is one printable line for the user."""

    def __str__(self) -> str:
        return printable(super().__str__())


class ParameterError(PiezoError, ValueError):
    """An invalid parameter value, name or unit."""


class RecordError(PiezoError, ValueError):
    """Samples, periods or labels that do not form a record."""


class ModelError(PiezoError, ValueError):
    """An inconsistent model or model file."""


class IdentificationError(PiezoError, RuntimeError):
    """The data do not determine the requested result."""


class StageError(PiezoError, OSError):
    """A stage refused, failed, or would have to leave its limits."""


class DeviceError(StageError):
    """The device refused, gave an invalid answer, or its link failed: a fault of the device and not of the user."""


class StoppedError(StageError):
    """Work on a device was interrupted by a stop; nothing was started afterwards."""


class UnknownVoltageError(StageError):
    """Nothing reports the voltage at which a device stands, so that no ramp can begin there."""


class RecordingError(PiezoError, OSError):
    """A recording that cannot be read or written."""


class MissingPackageError(PiezoError, ImportError):
    """A Python package that only one extra of this package needs is not installed.

    Parameters
    ----------
    what : str
        What needs it.
    package : str
        Its name.
    extra : str
        The extra that brings it.

    Examples
    --------
    >>> print(MissingPackageError("fleet", "dask", "fleet"))
    fleet: got no Python package 'dask', expected the extra 'fleet'; run: pip install 'piezo_hysteresis[fleet]'
    """

    def __init__(self, what: str, package: str, extra: str) -> None:
        super().__init__(what, package, extra)

    def __str__(self) -> str:
        what, package, extra = self.args
        return printable(
            f"{what}: got no Python package '{package}', expected the extra '{extra}'; "
            f"run: pip install 'piezo_hysteresis[{extra}]'"
        )


class DivergenceError(PiezoError, ArithmeticError):
    """A simulation diverged.

    Parameters
    ----------
    effect : str
        Identifier of the effect whose output diverged.
    sample : int
        Index of the first diverged or non-finite sample in the block.
    time : float
        Time of that sample since the start of the block [s].
    """

    def __init__(self, effect: str, sample: int, time: float) -> None:
        super().__init__(effect, sample, time)
        self.effect, self.sample, self.time = effect, sample, time

    def __str__(self) -> str:
        return printable(
            f"simulation diverged in '{self.effect}' at sample {self.sample} ({self.time:.6g} s): "
            "expected a bounded output; check its parameters (stable ARX, beta >= |gamma|) and the drive"
        )


class UnknownStateWarning(UserWarning):
    """A simulation that starts from rest although the record does not."""
