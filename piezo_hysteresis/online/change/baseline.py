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

"""`Baseline`: scatter of the scores of an unchanged stage, for every class of drive."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import ModelError
from .scatter import Scatter
from .score import GROUPS, ChangeScore

Array = NDArray[np.float64]

FORMAT = 3
"""Version of the file format. Only files of this version are read."""

FEWEST_SCORES = 60
"""Fewest scores of one class from which its scatter can be estimated."""

FEWEST_INDEPENDENT = 8.0
"""Fewest independent scores of one class. With fewer, Student's t of the threshold blinds the watch: with 8, a change
has to be 4 times as large as with very many, and with 2.5 it was 8000 times."""

CLASS_RATIO = 4.0
"""Width of a class: the spans of the drives of one class differ by at most this factor, and so do their speeds."""

DriveClass = tuple[int, int]


def drive_class(score: ChangeScore) -> DriveClass:
    """Class of the drive of a block: its span and its speed, in powers of `CLASS_RATIO`; (0, 0) for a held voltage."""
    if score.span == 0.0 or score.speed == 0.0:
        return 0, 0
    span, speed = (1000 + round(math.log(x, CLASS_RATIO)) for x in (score.span, score.speed))
    return span, speed


@dataclass(frozen=True, eq=False, slots=True)
class Baseline:
    """Scatter of scores by class of drive, taken while the stage agreed with the model.

    Parameters
    ----------
    scatter : mapping of (int, int) to Scatter
        Scatter by the value of `drive_class`.
    model : str
        Hash of the model that was running.
    sample_period : float
        Of the stream [s]. At another one, the same noise gives scores of another size.
    """

    scatter: Mapping[DriveClass, Scatter]
    model: str = ""
    sample_period: float = 0.0

    @classmethod
    def of(cls, scores: Sequence[ChangeScore], model: str = "", sample_period: float = 0.0) -> Baseline:
        """Baseline of a series of scores; classes with too few of them, or too few independent ones, are left out.

        Raises
        ------
        ModelError
            If no class has enough scores.
        """
        classes: dict[DriveClass, list[ChangeScore]] = {}
        for score in scores:
            classes.setdefault(drive_class(score), []).append(score)
        known = {key: Scatter.of(held) for key, held in classes.items() if len(held) >= FEWEST_SCORES}
        if not known:
            most = max(classes.values(), key=len, default=[])
            each = f" of {most[0].duration:.2g} s" if most else ""
            raise ModelError(
                f"baseline: got {len(most)} blocks{each} under one kind of drive, expected at least {FEWEST_SCORES}; "
                "drive the stage as in normal use for longer"
            )
        certain = {key: scatter for key, scatter in known.items() if scatter.independent >= FEWEST_INDEPENDENT}
        if not certain:
            largest = max(scatter.independent for scatter in known.values())
            raise ModelError(
                f"baseline: its scores drift and are worth {largest:.1f} independent ones, expected at least "
                f"{FEWEST_INDEPENDENT:g}; take one over a longer baseline_time, with the stage warm"
            )
        return cls(certain, model, sample_period)

    def of_model(self, model: str) -> Baseline:
        """The same scatter with the hash of another model, which may differ only in a few recalibrated parameters."""
        return Baseline(self.scatter, model, self.sample_period)

    def save(self, path: Path) -> None:
        """Write the baseline as .npz; the file appears only when it is complete."""
        own = {"format": FORMAT, "model": self.model, "sample_period": self.sample_period}
        arrays: dict[str, Any] = {name: np.array(value) for name, value in own.items()}
        for (span, speed), s in self.scatter.items():
            key = f"{span},{speed}"
            arrays |= {
                f"{key},count": np.array(s.count),
                f"{key},misfit": s.misfit,
                f"{key},precision": s.precision,
                f"{key},slope": s.slope,
                f"{key},memory": s.memory,
                f"{key},wander": s.wander,
                f"{key},power": np.array(s.power),
            }
        partial = path.with_suffix(".partial")
        with partial.open("wb") as file:
            np.savez(file, **arrays)
        partial.replace(path)

    @classmethod
    def load(cls, path: Path) -> Baseline:
        """Read a file that was written by `save`.

        Raises
        ------
        ModelError
            If the file does not hold a baseline.
        """
        size = len(GROUPS)
        square = (size, size)
        shapes: dict[str, tuple[int, ...]]
        shapes = {"misfit": (size,), "precision": square, "slope": square, "memory": (2, size), "wander": (size,)}
        shapes |= {"count": (), "power": ()}
        try:
            with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                held: dict[DriveClass, dict[str, Array]] = {}
                if "format" not in file or int(file["format"]) != FORMAT:
                    raise ValueError("another version wrote it, with another file format")
                for name in file.files:
                    if name in ("format", "model", "sample_period"):
                        continue
                    span, speed, field = name.split(",")
                    values = np.asarray(file[name], np.float64)
                    if values.shape != shapes[field] or not np.isfinite(values).all():
                        raise ValueError(name)
                    held.setdefault((int(span), int(speed)), {})[field] = values
                scatter = {
                    k: Scatter(
                        int(s["count"]),
                        s["misfit"],
                        s["precision"],
                        s["slope"],
                        s["memory"],
                        s["wander"],
                        float(s["power"]),
                    )
                    for k, s in held.items()
                }
                return cls(scatter, str(file["model"]), float(file["sample_period"]))
        except Exception as error:  # zipfile, zlib and numpy raise errors of many kinds on a damaged file
            raise ModelError(f"{path}: got no baseline of the change watch ({error}); take a new one") from None
