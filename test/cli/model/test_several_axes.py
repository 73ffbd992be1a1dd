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

"""``piezo identify`` and ``piezo validate`` for several axes: the verdict, and the status where data are damaged."""

from __future__ import annotations

import numpy as np

PERIOD = 1e-3


def write(path, clipped=False):
    """Two axes without memory, of which one may have a clipped sensor."""
    t = PERIOD * np.arange(4000)
    u, other = (5.0 - 5.0 * np.cos(2.0 * np.pi * f * t) for f in (1.0, 1.3))
    y = 1e-6 * u + 1e-8 * other
    y = np.minimum(y, 8e-6) if clipped else y
    np.savez(path, voltage=u, voltage_2=other, displacement=y, displacement_2=2e-6 * other, sample_period=PERIOD)
    return path


def test_a_model_of_several_axes_has_a_verdict(piezo, tmp_path):
    whole = write(tmp_path / "whole.npz")
    done = piezo("identify", whole, "-o", tmp_path / "model.npz", "--taps", 20)
    assert done.status == 0, done.err
    assert "The model describes this stage" in done.out.splitlines()[-1]
    assert piezo("validate", tmp_path / "model.npz", whole).status == 0


def test_a_clipped_sensor_makes_it_doubtful(piezo, tmp_path):
    piezo("identify", write(tmp_path / "whole.npz"), "-o", tmp_path / "model.npz", "--taps", 20)
    clipped = write(tmp_path / "clipped.npz", clipped=True)
    for words in (("validate", tmp_path / "model.npz", clipped), ("identify", clipped, "-o", tmp_path / "new.npz")):
        done = piezo(*words)
        assert done.status == 1, done.err
        assert "doubtful" in done.out.splitlines()[-1]
