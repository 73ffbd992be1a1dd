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

"""Labels come back with the samples they belong to, for every latency and every way of cutting the stream."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.acquisition.drive import Drive, Event, EventKind, Phase
from piezo_hysteresis.acquisition.latency_buffer import LatencyBuffer


@given(
    latency=st.integers(0, 40),
    sizes=st.lists(st.integers(1, 20), min_size=1, max_size=12),
    marks=st.lists(st.integers(0, 100), max_size=5),
)
def test_phases_and_events_are_those_of_the_stream_so_much_later(latency, sizes, marks):
    total = sum(sizes)
    phase = np.arange(total, dtype=np.uint32)
    events = [(m, Event(m, EventKind.BEGAN, Phase(m, "p"))) for m in sorted(marks) if m < total]
    late, first, got_phase, got_events = LatencyBuffer(latency, 7), 0, [], []
    for size in sizes:
        mine = tuple(Event(m - first, e.kind, e.phase) for m, e in events if first <= m < first + size)
        answer = late.follow(Drive(np.zeros(size), phase[first : first + size], mine))
        assert answer.phase.size == size
        assert all(0 <= e.offset < size for e in answer.events)
        got_phase.append(answer.phase)
        got_events += [(first + e.offset, e.phase.number) for e in answer.events]
        first += size
    np.testing.assert_array_equal(np.concatenate(got_phase), np.r_[np.full(latency, 7, np.uint32), phase][:total])
    assert got_events == [(m + latency, m) for m, _ in events if m + latency < total]
    assert late.has_settled(False, 50) == (latency == 0)
    assert late.has_settled(True, latency) == (len(got_events) == len(events))
