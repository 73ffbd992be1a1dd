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

"""One owner at a time, whatever anybody asks for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.acquisition.claim import Claim
from piezo_hysteresis.acquisition.settings import DRIVER
from piezo_hysteresis.errors import StageError

NAMES = st.sampled_from(["a", "b", "c.1"])
ASKED = st.lists(
    st.tuples(st.sampled_from(["take", "renew", "release", "expire"]), NAMES, st.floats(0.0, 3.0)), max_size=40
)


@given(ASKED)
def test_a_claim_changes_hands_only_when_it_was_given_up_or_has_expired(asked):
    claim, now, heard, owner = Claim(2.0), 0.0, 0.0, ""
    for what, name, later in asked:
        now += later
        if what == "take" and owner in ("", name):
            assert claim.take(name, now) == (owner == "")
            owner, heard = name, now
        elif what == "take":
            with pytest.raises(StageError, match=f"claimed by {owner}"):
                claim.take(name, now)
        elif what == "renew":
            assert claim.renew(name, now) == (name == owner)
            heard = now if name == owner else heard
        elif what == "release":
            assert claim.release(name) == (name == owner)
            owner = "" if name == owner else owner
        else:
            assert claim.has_expired(now) == (owner != "" and now - heard > 2.0)
        assert claim.owner == owner
        for other in ("", "a", "b", "c.1"):
            if other == owner:
                claim.require(other, "sine")
            else:
                with pytest.raises(StageError, match="sine: the stage is"):
                    claim.require(other, "sine")


@pytest.mark.parametrize("name", ["", "a b", "-x", "x" * 65, "a@b", "a\n", "é"])
def test_a_name_that_could_not_stand_in_a_command_is_refused(name):
    with pytest.raises(StageError, match="expected 1 to 64"):
        Claim(1.0).take(name, 0.0)


@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=40))
def test_the_shortest_time_out_keeps_a_claim_that_is_renewed_twice_a_second(late):
    shortest = next(row.lower for row in DRIVER if row.name == "claim_timeout")
    claim, now = Claim(shortest), 0.0
    claim.take("a", now)
    for delay in late:
        now += 0.5 + delay
        assert not claim.has_expired(now)
        assert claim.renew("a", now)
