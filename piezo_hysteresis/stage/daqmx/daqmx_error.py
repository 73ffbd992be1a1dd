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

"""`DaqmxError` and its kinds: what NI-DAQmx reports, as an error of this package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ...errors import DeviceError
from .setup import DaqmxSetup

_BUFFER_EMPTY = -200290
"""Error number of NI-DAQmx: the output has put out everything that was written, and holds its last sample."""


class DaqmxError(DeviceError):
    """NI-DAQmx reports a fault, or the card behaves wrongly."""


class UnsupportedError(DaqmxError):
    """The card refuses a request, and the link works."""


class EmptyBufferError(UnsupportedError):
    """The output has put out everything that was written, holds the last sample, and takes no other one.

    Parameters
    ----------
    text : str
        Text of the error.
    taken : int
        Number of samples that the failed call itself still wrote.
    """

    def __init__(self, text: str, taken: int = 0) -> None:
        super().__init__(text)
        self.taken = taken


@contextmanager
def reported(errors: Any, setup: DaqmxSetup, doing: str) -> Iterator[None]:
    """Raise the faults of NI-DAQmx within the block as DaqmxError.

    Parameters
    ----------
    errors : module
        ``nidaqmx.errors``.
    setup : DaqmxSetup
        Names the card and the server in the message.
    doing : str
        What is done in the block.
    """
    try:
        yield
    except DaqmxError:
        raise
    except (errors.Error, OSError, ValueError) as error:
        words = " ".join(str(error).split())
        if "DEADLINE_EXCEEDED" in str(getattr(error, "rpc_code", "")):
            words = f"no answer within {setup.timeout:g} s from {setup.server}"
        text = f"NI-DAQmx, {setup.device}: {doing} failed: {words[:300]}"
        if getattr(error, "error_code", None) == _BUFFER_EMPTY:
            raise EmptyBufferError(text, getattr(error, "samps_per_chan_written", 0)) from None
        raise (UnsupportedError if isinstance(error, errors.DaqError) else DaqmxError)(text) from None
