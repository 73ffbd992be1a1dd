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

"""Read an experiment of any format and list its phases: `python read_experiment.py PATH`."""

import sys

from piezo_hysteresis import read

experiment = read(sys.argv[1])
for record in experiment:
    volts, micrometres = record.voltage, record.displacement * 1e6
    print(
        f"{record.phase:14} {record.size:8} samples of {record.sample_period * 1e6:g} µs, "
        f"{volts.min():.2f} to {volts.max():.2f} V, {micrometres.min():.3f} to {micrometres.max():.3f} µm"
    )
for notice in experiment.notices:
    print(f"{notice.kind} {notice.phase}: {notice.message}")
