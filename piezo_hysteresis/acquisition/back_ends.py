"""Back ends of the driver: the word of the parameter `stage` -> how that stage is opened from ROS parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ParameterError, RecordingError, StageError
from ..parameter import Parameter, Row, Setting
from ..stage.hidden import hidden_effect
from ..stage.plant import PlantParameters
from ..stage.replay import ReplayStage
from ..stage.simulated import SimulatedMemoryStage, SimulatedStage
from ..stage.stage import Stage
from ..yaml_file import read_yaml
from .devices import GCS2, NIDAQMX, open_gcs2, open_nidaqmx


@dataclass(frozen=True, slots=True)
class BackEnd:
    """One kind of stage.

    Parameters
    ----------
    rows : tuple of Parameter or Setting
        Its ROS parameters, declared under the prefix ``"<word>."``.
    open : callable
        Makes the stage from the values of the rows and a sample period [s], 0 for the stage's own.
    is_device : bool
        True for hardware: locked by the name of the device, and never faster than real time.
    """

    rows: tuple[Row, ...]
    open: Callable[[Mapping[str, Any], float], Stage]
    is_device: bool


_PLANT = PlantParameters.table()
"""Parameters of the simulated plant."""

_SIMULATED: tuple[Row, ...] = (
    Setting("seed", 0, "fixes noise and random phases", lower=0, upper=2**31 - 1),
    Setting("memory", False, "true for a stage with on-board memory: upload, run, read"),
    Setting("longest_block", 32768, "samples that the memory holds", lower=2, upper=2**31 - 1),
    Parameter("dead_time", "t_d", "s", 0.05, 0.0, 100.0, "time that arming takes", "simulated plant"),
    Setting(
        "hidden_effect",
        -1,
        "seed that draws one effect to hide in the plant; -1: nothing hidden",
        lower=-1,
        upper=2**31 - 1,
    ),
    Setting("plant_file", "", "YAML file of plant parameters, which then count instead of the ones below"),
    Setting("hysteresis.operator", "bouc_wen", "hysteresis of the plant", ("bouc_wen", "prandtl_ishlinskii")),
    *_PLANT,
)
"""Parameters of the simulated stage."""

_REPLAY: tuple[Row, ...] = (
    Setting("experiment", "", "path of the recording"),
    Setting("repeat", False, "begin again after the last sample"),
    Setting("subscribers", 0, "begin when so many subscribers of samples are there", lower=0, upper=1000),
)
"""Parameters of a replayed recording."""


def _open_simulated(values: Mapping[str, Any], sample_period: float) -> Stage:
    named = {"seed": values["seed"], **({"sample_period": sample_period} if sample_period else {})}
    plant = PlantParameters.from_mapping(_plant_values(values))
    if values["hidden_effect"] >= 0:
        plant = hidden_effect(values["hidden_effect"], plant).parameters
    if values["memory"]:
        return SimulatedMemoryStage(
            plant, longest_block=values["longest_block"], dead_time=values["dead_time"], **named
        )
    return SimulatedStage(plant, **named)


def _plant_values(values: Mapping[str, Any]) -> Mapping[str, Any]:
    if values["plant_file"]:
        return _read_mapping(Path(values["plant_file"]).expanduser())
    changed = {row.name: values[row.name] for row in _PLANT if values[row.name] != row.value}
    return {"hysteresis.operator": values["hysteresis.operator"], **changed}


def _read_mapping(path: Path) -> Mapping[str, Any]:
    try:
        mapping = read_yaml(path)
    except RecordingError as error:
        raise StageError(f"simulated.plant_file: {error}") from None
    except OSError as error:
        raise StageError(f"simulated.plant_file: cannot read {path} ({error.strerror})") from None
    if not isinstance(mapping, Mapping):
        raise StageError(f"simulated.plant_file: {path} holds no mapping, expected plant parameters by name")
    return mapping


def _open_replay(values: Mapping[str, Any], sample_period: float) -> Stage:
    path = values["experiment"]
    if not path:
        raise RecordingError("replay.experiment: got no path, expected that of a recording")
    from .. import recording  # not needed by any other back end, and slow to import

    records = recording.read(path).records
    if sample_period:
        records = tuple(r for r in records if abs(r.sample_period / sample_period - 1) < 1e-6)
    return ReplayStage(records, name=f"replay of {Path(path).name}", repeat=values["repeat"])


BACK_ENDS: Mapping[str, BackEnd] = {
    "simulated": BackEnd(_SIMULATED, _open_simulated, is_device=False),
    "replay": BackEnd(_REPLAY, _open_replay, is_device=False),
    "gcs2": BackEnd(GCS2, open_gcs2, is_device=True),
    "nidaqmx": BackEnd(NIDAQMX, open_nidaqmx, is_device=True),
}
"""Every back end by its word."""


def open_stage(word: str, values: Mapping[str, Any], sample_period: float, real_time_factor: float) -> Stage:
    """Open a stage at a sample period.

    Parameters
    ----------
    word : str
        Key of `BACK_ENDS`.
    values : mapping
        Of its rows, by name.
    sample_period : float
        Time between samples [s]; 0 for the stage's own.
    real_time_factor : float
        Seconds of the stage per second.

    Raises
    ------
    PiezoError
        If the stage cannot be opened like that; one that was opened is closed again.
    """
    if real_time_factor != 1.0 and word != "simulated":
        raise ParameterError(
            f"real_time_factor: got {real_time_factor:g} for stage '{word}', expected 1; only 'simulated' has another"
        )
    stage = BACK_ENDS[word].open(values, sample_period)
    try:
        stage.configure(sample_period or stage.sample_period)
    except BaseException:
        stage.close()
        raise
    return stage
