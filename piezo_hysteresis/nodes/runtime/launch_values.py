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

"""Values of launch arguments, converted from text; invalid words are refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from ...errors import ParameterError, printable
from ...home_path import in_home

Number = TypeVar("Number", int, float)

SWITCH: dict[str, bool] = {
    "true": True,
    "True": True,
    "1": True,
    "false": False,
    "False": False,
    "0": False,
}
"""Words for yes and no."""

LISTENING = "listening on samples"
"""Line in the log of a model node from which on it takes samples; a launch file waits for it."""

CHOSEN = ("FASTDDS_BUILTIN_TRANSPORTS", "FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
"""Variables by which a user chooses the transports of Fast DDS."""


def transports(environment: Mapping[str, str], config: Path) -> dict[str, str]:
    """Environment variables for the nodes of a launch file, added to `environment`; none where the user has set them.

    A killed reader keeps its part of the shared memory until it is detected a second later. With enough memory for that
    second the other readers are not affected.

    Parameters
    ----------
    environment : mapping
        Environment variables of the launch.
    config : Path
        Folder of the configuration files.
    """
    if any(environment.get(name) for name in CHOSEN):
        return {}
    return {"FASTDDS_DEFAULT_PROFILES_FILE": str(config / "launch_transports.xml")}


def switch(name: str, text: str) -> bool:
    """True or false from one of the words of `SWITCH`.

    Raises
    ------
    ParameterError
        If the word is another one.
    """
    if text not in SWITCH:
        raise ParameterError(f"{name}: got '{printable(text)}', expected one of {', '.join(SWITCH)}")
    return SWITCH[text]


def parameter_file(name: str, text: str) -> list[str]:
    """The file that an argument names, in a list; an empty argument gives an empty list.

    Raises
    ------
    ParameterError
        If there is no such file, because the nodes would start with their defaults, on a simulated stage.
    """
    if not text:
        return []
    path = in_home(text)
    if not path.is_file():
        raise ParameterError(f"{name}: got '{printable(text)}', expected a file that exists")
    return [str(path)]


def number(name: str, text: str) -> float:
    """A number.

    Raises
    ------
    ParameterError
        On any other text.
    """
    return _converted(name, text, float, "a number")


def whole_number(name: str, text: str) -> int:
    """A whole number; otherwise as `number`."""
    return _converted(name, text, int, "a whole number")


def _converted(name: str, text: str, kind: Callable[[str], Number], expected: str) -> Number:
    try:
        return kind(text)
    except ValueError:
        raise ParameterError(f"{name}: got '{printable(text)}', expected {expected}") from None


def replayed(stage: str) -> str:
    """The back end that plays a recording, where the argument is empty or names it.

    Raises
    ------
    ParameterError
        Where another back end is named.
    """
    if stage not in ("", "replay"):
        raise ParameterError(f"stage: got '{printable(stage)}' beside an experiment to replay, expected 'replay'")
    return "replay"


def require_computer_clock(is_simulated: bool) -> None:
    """Refuse the clock of /clock for a process that contains a driver.

    Raises
    ------
    ParameterError
        Where it is asked for; the driver in the process would refuse it and end all nodes.
    """
    if is_simulated:
        raise ParameterError(
            "use_sim_time: got true with one_process, expected false; a driver stamps samples by the computer's clock"
        )
