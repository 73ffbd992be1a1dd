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

"""`one_axis`: whether a model of one axis can describe records."""

from __future__ import annotations

from collections.abc import Iterable

from ...errors import RecordError
from ...model.axes_samples import names
from ...record import Notice, Record


def one_axis(records: Iterable[Record]) -> tuple[Notice, ...]:
    """Refuse records of several drives, and tell of displacements that a model of one axis leaves out.

    Parameters
    ----------
    records : iterable of Record
        Records that are fitted by a model of one axis or compared with it.

    Returns
    -------
    tuple of Notice
        ``axes`` where there are several displacements.

    Raises
    ------
    RecordError
        If a record has several drives.
    """
    left_out: dict[str, None] = {}
    for record in records:
        drives = names(record, "voltage")
        if len(drives) > 1:
            raise RecordError(
                f"{record.phase}: got the drives {', '.join(drives)}, expected one, because a model of one axis would "
                "take the motion by the others for its own; several axes are identified together by piezo identify "
                "-o model.npz; leave drives that are held out of the file"
            )
        left_out |= dict.fromkeys(names(record, "displacement")[1:])
    if not left_out:
        return ()
    message = "not used, because a model of one axis describes one displacement; piezo identify describes all of them"
    return (Notice("axes", f"{', '.join(left_out)}: {message}"),)
