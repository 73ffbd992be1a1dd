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

"""Any bytes to or from a controller give a value that makes sense or one clear error."""

import math
import socket
import threading
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from piezo_hysteresis.emulators.gcs2 import answer
from piezo_hysteresis.emulators.gcs2.controller import BYTES, Controller
from piezo_hysteresis.emulators.gcs2.server import Gcs2Server, cut
from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.gcs2.array_answer import ArrayAnswer
from piezo_hysteresis.stage.gcs2.axis import NEEDED
from piezo_hysteresis.stage.gcs2.client import Client
from piezo_hysteresis.stage.gcs2.connection import Connection
from piezo_hysteresis.stage.simulated import SimulatedStage

many = settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])

WORDS = st.sampled_from(
    [
        "0",
        "1",
        "2",
        "-1",
        "8",
        "9",
        "1e3",
        "nan",
        "inf",
        "-inf",
        "1e400",
        "0x0E000200",
        "X",
        "&",
        "PNT",
        "",
        "é",
        "1" * 400,
    ]
)
LINES = st.binary(max_size=20).map(lambda line: line.decode("cp1252", errors="replace").replace("\n", " "))
HEADER = st.lists(
    st.one_of(
        st.builds("# {} = {}".format, st.sampled_from(["SEPARATOR", "DIM", "SAMPLE_TIME", "NDATA"]), WORDS),
        st.sampled_from(["# ", "# END_HEADER", "#END_HEADER", "END_HEADER"]),
        LINES,
    ),
    max_size=8,
)
ROWS = st.lists(st.one_of(st.lists(WORDS, max_size=4).map(" ".join), LINES), max_size=4)


@many
@given(HEADER, ROWS, st.integers(0, 4), st.integers(1, 3))
@example(["# SEPARATOR = 99999999999999999999", "# END_HEADER"], ["1 2"], 1, 2)
@example(["# SEPARATOR = 1114112", "# END_HEADER"], ["1 2"], 1, 2)
def test_an_array_is_whole_and_finite_or_refused(header, rows, count, columns):
    try:
        array = ArrayAnswer.parse([*header, "# END_HEADER", *rows], count, columns)
    except StageError:
        return
    assert array.values.shape == (count, columns)
    assert np.isfinite(array.values).all()
    assert array.sample_time is None or 0 < array.sample_time < math.inf


@many
@given(
    st.integers(1, 5).flatmap(
        lambda n: st.lists(st.lists(st.floats(-1e30, 1e30), min_size=n, max_size=n), min_size=1, max_size=6)
    ),
    st.floats(1e-6, 1.0),
)
def test_an_array_reads_back_unchanged(values, sample_time):
    values = np.array(values)
    lines = answer.array(values, sample_time, [f"column {i}" for i in range(values.shape[1])])
    read = ArrayAnswer.parse(lines, *values.shape)
    np.testing.assert_allclose(read.values, values, rtol=1e-8)
    assert read.sample_time == pytest.approx(sample_time, rel=1e-8)


@contextmanager
def babbling(said):
    """A host that answers the first bytes with a given reply, and then closes the link."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve():
            link, _ = listener.accept()
            with link:
                link.recv(1 << 16)
                link.sendall(said)
                link.shutdown(socket.SHUT_WR)
                while link.recv(1 << 16):
                    pass

        thread = threading.Thread(target=serve)
        thread.start()
        connection = Connection("127.0.0.1", listener.getsockname()[1], 5.0)
        connection.send("")
        connection._opened().sendall(b"\n")
        yield Client(connection)
        connection.close()
        thread.join()


QUESTIONS = {
    "ask": lambda client: client.ask("SAI?"),
    "number": lambda client: client.number("VOL? 1"),
    "whole": lambda client: client.whole("SVO? 1"),
    "array": lambda client: client.array("DRR? 1 2 1 2", 2, 2),
    "generators_running": lambda client: client.generators_running(),
    "command": lambda client: client.command("SVA 1 1"),
    "stop": lambda client: client.stop(),
}

ANSWERS = st.one_of(
    st.binary(max_size=60),
    st.lists(st.one_of(WORDS, st.builds("1={}".format, WORDS), st.just("# END_HEADER")), max_size=6).map(
        lambda lines: (" \n".join(lines) + "\n0\n").encode("cp1252")
    ),
)


@many
@given(st.sampled_from(sorted(QUESTIONS)), ANSWERS)
@example("number", b"1=nan\n0\n")
@example("whole", b"1=1e999\n0\n")
@example("generators_running", b"-0x1\n")
@example("number", b"1=0.5\nnan\n")
def test_any_answer_gives_a_value_that_makes_sense_or_one_clear_error(question, said):
    with babbling(said) as client:
        try:
            value = QUESTIONS[question](client)
        except StageError:
            return
    if question in ("number", "whole", "generators_running"):
        assert math.isfinite(value)
    if question == "generators_running":
        assert value >= 0
    if question == "array":
        assert np.isfinite(value.values).all()


@pytest.mark.parametrize("said", ["1_0", "١", "0x1", "1 0", "-", "1.0", "0000000"])
def test_an_error_number_has_nothing_but_digits(said):
    """Python reads '1_0' as ten, and '0000000' as no error."""
    with babbling(f"{said}\n".encode()) as client, pytest.raises(StageError, match="expected an error number"):
        client.command("SVA 1 1")


@pytest.fixture(scope="module")
def controller():
    return Controller(SimulatedStage(sample_period=50e-6), speed=math.inf, recorder_points=8 * 100)


@pytest.fixture(scope="module")
def served(controller):
    with Gcs2Server(controller) as server:
        yield server


OTHERS = "ERR? MOV HLP? CSV? HPA? *IDN? DRC? DRT DRT? GWD? HDR? OVF? PUN? RTR? SPA SVA? TMN? TMX? WGR WGO? WMS? WSL?"
MNEMONICS = st.sampled_from([*NEEDED, *OTHERS.split(), *BYTES])
COMMANDS = st.one_of(
    st.tuples(MNEMONICS, st.lists(WORDS, max_size=6)).map(lambda c: " ".join((c[0], *c[1]))), st.text()
)


@many
@given(st.lists(COMMANDS, min_size=1, max_size=20))
@example(["WAV 1 X PNT 1 1 0", "WSL 1 1", "WGC 1 999999999999", "WGO 1 1"])
@example(["WAV 1 X PNT 1 1 0", "WSL 1 1", "WGC 1 1", "WTR 1 999999999999 0", "WGO 1 1"])
@example(["RTR 99999999999999999999", "WAV 1 X PNT 1 1 0", "WSL 1 1", "WGO 1 1", "DRR?"])
@example(["WOS 1 nan", "WAV 1 X PNT 1 1 0", "WSL 1 1", "WGC 1 1", "WTR 1 1 0", "WGO 1 1"])
def test_no_command_upsets_an_emulated_controller(controller, lines):
    for line in lines:
        reply = controller.carry_out(line)
        assert reply.lines is None or all("\n" not in part for part in reply.lines)
    for settle in ("\x18", "RTR 1", "WGC 1 1", "WTR 1 1 0", "WOS 1 0", "SVO 1 0", "ERR?"):
        controller.carry_out(settle)
    assert controller.carry_out("ERR?").lines == ["0"]
    (voltage,) = controller.carry_out("VOL? 1").lines
    assert 0.0 <= float(voltage.partition("=")[2]) <= 200.0


@many
@given(st.binary(max_size=80), st.lists(st.integers(0, 80), max_size=5))
def test_commands_are_the_same_however_they_are_cut(sent, places):
    whole, rest = cut(sent)
    found, waiting = [], b""
    edges = [0, *sorted(min(place, len(sent)) for place in places), len(sent)]
    for first, end in zip(edges, edges[1:], strict=False):
        commands, waiting = cut(waiting + sent[first:end])
        found += commands
    assert (found, waiting) == (whole, rest)


@many
@given(st.binary(max_size=200))
@example(b"DRT 1 1 \x81\nDRT? 1\n")
def test_after_any_bytes_the_next_one_is_served(served, sent):
    with socket.create_connection((served.host, served.port)) as link:
        link.sendall(sent + b"\n")
        link.shutdown(socket.SHUT_WR)
        while link.recv(1 << 16):
            pass
    client = Client(Connection(served.host, served.port, 5.0))
    assert "EMULATED" in client.value("*IDN?")
    client.connection.close()
