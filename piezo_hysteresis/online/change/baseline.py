"""`Baseline`: scatter of the scores of an unchanged stage, for every class of drive."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ...errors import ModelError
from .score import GROUPS, ChangeScore

Array = NDArray[np.float64]

FEWEST_SCORES = 60
"""Scores of one class from which its scatter is known well enough to watch."""

CLASS_RATIO = 4.0
"""Drives whose span or speed differs by less than this factor are of one class."""

DISTINCT = 1e-6
"""Smallest part of a row of sensitivities, after the offset is taken out, that counts as excited."""

SLOWEST_DECAY = 0.98
"""Factor from score to score with which a correlation falls at least: 5 s."""

DriveClass = tuple[int, int]


def drive_class(score: ChangeScore) -> DriveClass:
    """Class of the drive of a block: its span and its speed, in powers of `CLASS_RATIO`; (0, 0) for a held voltage."""
    if score.span == 0.0 or score.speed == 0.0:
        return 0, 0
    return tuple(1000 + round(math.log(x, CLASS_RATIO)) for x in (score.span, score.speed))  # type: ignore[return-value]


@dataclass(frozen=True, eq=False, slots=True)
class Scatter:
    """Scores of one class of drive.

    Parameters
    ----------
    count : int
        Number of scores.
    mean : (5,) ndarray
        Mean score: structured misfit of the model under this drive. It does not count as change.
    whitening : (5, 5) ndarray
        Inverse of the covariance of the scores; rows and columns of groups that are not excited are zero.
    slope : (5, 5) ndarray
        Mean of `ChangeScore.slope`.
    memory : (2, 5) ndarray
        Correlation of what successive scores say of each group, and the factor by which it falls with every further
        score.
    """

    count: int
    mean: Array
    whitening: Array
    slope: Array
    memory: Array

    @property
    def excited(self) -> NDArray[np.bool_]:
        """Groups that the drive excites, shape (5,)."""
        return np.diag(self.whitening) > 0.0

    def inflation(self, longest: int) -> Array:
        """Variance of the sum of 1, 2, … `longest` scores over that of as many independent ones, shape (longest, 5)."""
        lag = np.arange(1, longest)[:, None]
        correlation = self.memory[0] * self.memory[1] ** (lag - 1)
        total, first = (np.vstack((np.zeros((1, 5)), np.cumsum(c, axis=0))) for c in (correlation, lag * correlation))
        return 1.0 + 2.0 * (total - first / np.arange(1, longest + 1)[:, None])

    @classmethod
    def of(cls, scores: Sequence[ChangeScore]) -> Scatter:
        """Scatter of the scores of one class."""
        values = np.array([s.value for s in scores])
        slope = np.mean([s.slope for s in scores], axis=0)
        size = np.sqrt(np.diag(slope))
        offset = GROUPS.index("offset")
        apart = np.diag(slope) - slope[:, offset] ** 2 / slope[offset, offset]
        kept = np.flatnonzero((apart > DISTINCT**2 * np.diag(slope)) | (np.arange(len(GROUPS)) == offset))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        scaled = (values * scale)[:, kept]
        covariance = np.atleast_2d(np.cov(scaled, rowvar=False))
        inverse = np.zeros_like(slope)
        biased = (len(scores) - kept.size - 2) / (len(scores) - 1)  # mean of the inverse of a Wishart matrix
        inverse[np.ix_(kept, kept)] = biased * np.linalg.pinv(covariance, rcond=1e-10, hermitian=True)
        mean, whitening = values.mean(axis=0), scale[:, None] * inverse * scale
        said = (values - mean) @ whitening @ slope
        return cls(len(scores), mean, whitening, slope, _memory(said))


def _memory(said: Array) -> Array:
    """`Scatter.memory` of a series (n, 5); correlations within two standard errors of zero are none."""
    power = np.maximum((said**2).mean(axis=0), np.finfo(np.float64).tiny)
    one, two = ((said[lag:] * said[:-lag]).mean(axis=0) / power for lag in (1, 2))
    first = np.where(one > 2.0 / np.sqrt(len(said)), np.minimum(one, 1.0), 0.0)
    decay = np.clip(two / np.where(first > 0.0, first, 1.0), 0.0, SLOWEST_DECAY)
    return np.vstack((first, np.where(first > 0.0, decay, 0.0)))


@dataclass(frozen=True, eq=False, slots=True)
class Baseline:
    """Scatter of scores by class of drive, taken while the stage agreed with the model.

    Parameters
    ----------
    scatter : mapping of (int, int) to Scatter
        By `drive_class`.
    model : str
        Hash of the model that ran.
    """

    scatter: Mapping[DriveClass, Scatter]
    model: str = ""

    @classmethod
    def of(cls, scores: Sequence[ChangeScore], model: str = "") -> Baseline:
        """Baseline of a series of scores; classes with too few of them are left out.

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
            most = max(map(len, classes.values()), default=0)
            raise ModelError(
                f"baseline: got {most} blocks of 0.1 s under one kind of drive, expected at least {FEWEST_SCORES}; "
                "drive the stage as in normal use for longer"
            )
        return cls(known, model)

    def save(self, path: Path) -> None:
        """Write as .npz, whole or not at all."""
        arrays: dict[str, Any] = {"model": np.array(self.model)}
        for (span, speed), s in self.scatter.items():
            key = f"{span},{speed}"
            arrays |= {
                f"{key},count": np.array(s.count),
                f"{key},mean": s.mean,
                f"{key},whitening": s.whitening,
                f"{key},slope": s.slope,
                f"{key},memory": s.memory,
            }
        partial = path.with_suffix(".partial")
        with partial.open("wb") as file:
            np.savez(file, **arrays)
        partial.replace(path)

    @classmethod
    def load(cls, path: Path) -> Baseline:
        """Read what `save` wrote.

        Raises
        ------
        ModelError
            If the file is no baseline.
        """
        size = len(GROUPS)
        shapes = {"count": (), "mean": (size,), "whitening": (size, size), "slope": (size, size), "memory": (2, size)}
        try:
            with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                held: dict[DriveClass, dict[str, Array]] = {}
                for name in file.files:
                    if name == "model":
                        continue
                    span, speed, field = name.split(",")
                    values = np.asarray(file[name], np.float64)
                    if values.shape != shapes[field] or not np.isfinite(values).all():
                        raise ValueError(name)
                    held.setdefault((int(span), int(speed)), {})[field] = values
                scatter = {
                    k: Scatter(int(s["count"]), s["mean"], s["whitening"], s["slope"], s["memory"])
                    for k, s in held.items()
                }
                return cls(scatter, str(file["model"]))
        except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
            raise ModelError(f"{path}: got no baseline of the change watch ({error}); take a new one") from None
