"""A folder of ``NN_<phase>.npz``, one file per phase: the plainest form of an experiment."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RecordingError
from ..record import Experiment, Notice, Record, Samples
from .damage import naming
from .finite import finite_records
from .guess import guess_notice, guessed, guessed_period, unit_in
from .layout import CHANNELS, LABELS, Layout
from .phases import labelled
from .time_base import TimeBase

_MAGIC_READERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_LARGEST_EXPANSION = 100
_SMALL = 1 << 26
_NUMBERED = re.compile(r"\d+[_ -]")


class Npz:
    """Folder of ``NN_<phase>.npz`` files, or one such file.

    Keys `voltage` [V], `displacement` [m], `sample_period` [s], `start_time` [s] and `phase`; optional `continues`,
    `truncated`, `initial_voltage` [V], `other_displacement` [m], `temperature` [K]. Other keys are ignored, unless
    `Layout.columns` names them for a channel. Pickled objects are refused.
    """

    averages = False

    def recognises(self, path: Path) -> bool:
        """True for an .npz file or a folder that holds one."""
        return path.suffix == ".npz" if path.is_file() else any(path.glob("*.npz"))

    def read(self, path: Path, layout: Layout) -> Experiment:
        """The phases in the order of their file numbers."""
        files = [path] if path.is_file() else sorted(path.glob("*.npz"), key=_order)
        records: list[Record] = []
        notices: list[Notice] = []
        if len(files) > 1 and not isinstance(layout.phases, str | None):
            raise RecordingError(f"{path}: got start times of phases for {len(files)} files, expected one record")
        end = 0.0
        for file in files:
            with naming(file, "an .npz file with voltage, displacement and sample_period"):
                parts, told = _phase(file, layout, end)
            records += parts
            notices += told
            end = parts[-1].start_time + parts[-1].duration
        return Experiment(tuple(records), str(path), tuple(notices))

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write every record to its file in a folder that holds no other experiment.

        Raises
        ------
        RecordingError
            If the folder already holds .npz files or cannot be written.
        """
        with naming(path, "a folder that can be written"):
            path.mkdir(parents=True, exist_ok=True)
            if any(path.glob("*.npz")):
                raise RecordingError("holds an experiment already; choose an empty folder")
            for number, record in enumerate(experiment, 1):
                name = re.sub(r"[^\w.+-]", "_", record.phase)
                np.savez(path / f"{number:02d}_{name}.npz", **_keys(record))


def _phase(file: Path, layout: Layout, end: float) -> tuple[list[Record], list[Notice]]:
    """Records of one file; `end` is where the one before it ended [s]."""
    with zipfile.ZipFile(file) as archive:
        values = _Members(archive, file.stat().st_size)
        place = {name: str(layout.columns.get(name, name)) for name in (*CHANNELS, *LABELS)}
        open_ = [c for c in ("voltage", "displacement") if c not in layout.columns and c not in values]
        names = [name for name in values.names() if name not in place.values()]
        guess = {c: names[at] for c, at in guessed(names, (), open_).items()}
        place |= guess
        units = {c: unit_in(name, c) for c, name in place.items() if c in CHANNELS}
        whole = values.numbers(place["voltage"])
        part = layout.part(whole.size)

        def channel(name: str) -> Samples:
            samples = whole if name == "voltage" else values.numbers(place[name])
            return layout.in_si(name, samples[part] if layout.rows else samples, units.get(name))

        def number(name: str, default: float | None) -> float | None:
            return values.number(place[name]) if place[name] in values else default

        period, breaks, told = _time_base(values, place, layout, part)
        optional = [name for name in ("other_displacement", "temperature") if place[name] in values]
        named = place["phase"] in values or _NUMBERED.match(file.name)
        records, notices = finite_records(
            {name: channel(name) for name in ("voltage", "displacement", *optional)},
            period,
            breaks,
            phase=values.text(place["phase"], _NUMBERED.sub("", file.stem)),
            start_time=number("start_time", end),
            continues=bool(number("continues", 0.0)),
            truncated=bool(number("truncated", 0.0)) or layout.truncates(part),
            initial_voltage=number("initial_voltage", None),
        )
    notices += [*told, *guess_notice(guess, units)]
    if named and layout.phases is None:
        return records, notices
    records, told = labelled(records, layout.phases)
    return records, [*notices, *told]


def _time_base(
    values: _Members, place: dict[str, str], layout: Layout, part: slice
) -> tuple[float, dict[int, int], list[Notice]]:
    """Sample period [s] from wherever the file tells it; missing samples, where it holds times; what to tell."""
    if layout.sample_period is not None:
        return layout.sample_period, {}, []
    if place["sample_period"] in values or "sample_period" in layout.columns:
        return float(layout.in_si("sample_period", np.array(values.number(place["sample_period"])))), {}, []
    if place["time"] in values:
        base = TimeBase.of(layout.in_si("time", values.numbers(place["time"])[part], unit_in(place["time"], "time")))
        return base.period, dict(zip(base.breaks.tolist(), base.lost.tolist(), strict=True)), base.notices()
    if found := guessed_period(values.names()):
        value = values.number(found[0])
        return (1.0 / value if found[1] else value), {}, []
    return values.number(place["sample_period"]), {}, []  # raises, and says what the file holds


def _keys(record: Record) -> dict[str, Any]:
    keys: dict[str, Any] = {
        "voltage": record.voltage,
        "displacement": record.displacement,
        "sample_period": record.sample_period,
        "start_time": record.start_time,
        "phase": record.phase,
    }
    keys |= {name: True for name in ("continues", "truncated") if getattr(record, name)}
    optional = ("initial_voltage", "other_displacement", "temperature")
    return keys | {name: getattr(record, name) for name in optional if getattr(record, name) is not None}


def _order(file: Path) -> tuple[float, str]:
    number = re.match(r"\d{1,9}", file.name)
    return (float(number[0]) if number else float("inf"), file.name)


def _scalar(name: str, value: Samples) -> float:
    if value.size != 1:
        raise RecordingError(f"{name}: got shape {value.shape}, expected one number")
    return float(value.reshape(()))


class _Members:
    """Arrays of a zip archive, none of them larger than the file can justify."""

    def __init__(self, archive: zipfile.ZipFile, file_size: int) -> None:
        self._archive = archive
        self._members = {m.filename.removesuffix(".npy"): m for m in archive.infolist()}
        self._budget = max(_SMALL, _LARGEST_EXPANSION * file_size)

    def __contains__(self, name: object) -> bool:
        return name in self._members

    def names(self) -> list[str]:
        return list(self._members)

    def array(self, name: str) -> np.ndarray[Any, Any]:
        member = self._members.get(name)
        if member is None:
            held = ", ".join(sorted(self._members)[:20]) or "nothing"
            raise RecordingError(f"holds {held}, expected the key '{name}'; name it by columns or options")
        with self._archive.open(member) as stream:
            version = np.lib.format.read_magic(stream)
            if version not in _MAGIC_READERS:
                raise RecordingError(f"{name}: got npy version {version}, expected 1.0 or 2.0")
            shape, _, dtype = _MAGIC_READERS[version](stream)
            declared = int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize
        if dtype.hasobject:
            raise RecordingError(f"{name}: got pickled objects, expected numbers or text")
        self._budget -= declared
        if declared > member.file_size or self._budget < 0:
            raise RecordingError(f"{name}: declares {declared} bytes, more than the file can hold")
        with self._archive.open(member) as stream:
            return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))

    def numbers(self, name: str) -> Samples:
        values = self.array(name)
        if values.dtype.kind not in "fiub":
            raise RecordingError(f"{name}: got {values.dtype}, expected real numbers")
        return values.astype(np.float64)

    def number(self, name: str) -> float:
        return _scalar(name, self.numbers(name))

    def text(self, name: str, default: str) -> str:
        if name not in self:
            return default
        value = self.array(name)
        if value.size != 1 or value.dtype.kind not in "US":
            raise RecordingError(f"{name}: got {value.dtype} of shape {value.shape}, expected one text")
        word = value.reshape(()).item()
        return word.decode("utf-8") if isinstance(word, bytes) else str(word)
