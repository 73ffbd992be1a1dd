"""Values of launch arguments, which are all text, as what they mean; other words are refused."""

from __future__ import annotations

from pathlib import Path

from ...errors import ParameterError, printable

SWITCH: dict[str, bool] = {
    "true": True,
    "True": True,
    "1": True,
    "false": False,
    "False": False,
    "0": False,
}
"""Words for yes and no."""


def switch(name: str, text: str) -> bool:
    """True or false from one of the words of `SWITCH`.

    Raises
    ------
    ParameterError
        On any other word.
    """
    if text not in SWITCH:
        raise ParameterError(f"{name}: got '{printable(text)}', expected one of {', '.join(SWITCH)}")
    return SWITCH[text]


def parameter_file(name: str, text: str) -> list[str]:
    """The file that an argument names, as a list of one; of none where it is empty.

    Raises
    ------
    ParameterError
        If there is no such file: nodes would start with their defaults, on a simulated stage.
    """
    if not text:
        return []
    path = Path(text).expanduser()
    if not path.is_file():
        raise ParameterError(f"{name}: got '{printable(text)}', expected a file that exists")
    return [str(path)]
