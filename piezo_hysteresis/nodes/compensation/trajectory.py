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

"""Conversion of trajectories to messages (clouds with the field `displacement`), and of plans to text."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2

from ...compensation import Plan
from ...errors import RecordError
from ...parameter import slew_text
from ..messages.cloud import from_cloud, to_cloud
from ..messages.conversions import PERIOD_TOLERANCE, with_phase

Array = NDArray[np.float64]


def trajectory_from_cloud(cloud: PointCloud2, sample_period: float, longest: float) -> Array:
    """Wanted displacement [m] of a message of `trajectory`, shape (n,).

    Raises
    ------
    RecordError
        On a cloud without `displacement`, a `time` of another period, samples that are not finite, or too many of them.
    """
    arrays = from_cloud(cloud, {"displacement": "f8"}, {"time": "f8"})
    wanted, time = arrays["displacement"], arrays.get("time")
    if wanted.size == 0:
        raise RecordError("trajectory: got no samples, expected at least one")
    if wanted.size * sample_period > longest:
        raise RecordError(
            f"trajectory: got {wanted.size * sample_period:.6g} s, expected at most {longest:g} s (longest_trajectory)"
        )
    if time is not None and time.size > 1:
        off = np.abs(time - time[0] - sample_period * np.arange(time.size))
        if not off.max() <= PERIOD_TOLERANCE * sample_period:
            got = float(time[-1] - time[0]) / (time.size - 1)
            raise RecordError(f"trajectory: got a period of {got:g} s, expected {sample_period:g} s (the driver's)")
    return np.array(wanted, dtype=np.float64)


def trajectory_to_cloud(displacement: ArrayLike, phase: str, stamp: Time) -> PointCloud2:
    """The message of `trajectory` for a wanted displacement (n,) [m]."""
    columns = {"displacement": np.array(displacement, dtype=np.float64)}
    return with_phase(to_cloud(columns, {"displacement": "f8"}, stamp), phase)


def described(plan: Plan, learned: float | None = None) -> str:
    """Description of a plan in one line; `learned` is the error [m] that learning expects of a corrected path."""
    expected = plan.expected
    total = expected.total if learned is None else learned
    stated = "no free-run error stated" if expected.free_run is None else f"model {1e9 * expected.free_run:.1f} nm"
    if (expected.parameters or 0.0) > (expected.free_run or 0.0):
        stated += f", its parameters {1e9 * (expected.parameters or 0.0):.1f} nm on this path"
    return (
        f"{plan.voltage.size * plan.sample_period:.3g} s, {plan.voltage.min():.3g} to {plan.voltage.max():.3g} V, "
        f"at most {slew_text(plan.largest_slew, 4)}, expected error {1e9 * total:.1f} nm rms"
        + (f" (plan {1e9 * expected.planned:.1f} nm, {stated}), " if total == expected.total else ", ")
        + ("the whole path is reachable" if plan.reachability.is_whole else why_not(plan))
        + doubts(plan)
    )


def doubts(plan: Plan) -> str:
    """Why the error on a path can exceed the expected one; empty if nothing speaks for it."""
    return doubt(plan) + "".join(f"; {said}; the error may be larger there" for said in plan.beyond)


def doubt(plan: Plan) -> str:
    """`doubts` about the start alone."""
    if plan.start_is_known:
        return ""
    return "; the stage was driven before its voltages were received, so that the error can be larger"


def why_not(plan: Plan) -> str:
    """Reason why a path is refused, and the nearest reachable path."""
    part, nearest = plan.reachability.parts[0], plan.reachability.nearest
    ways = "" if nearest is None else nearest.conditions()
    return f"not reachable: {part}" + (f"; the whole path can be reached {ways}" if ways else "")
