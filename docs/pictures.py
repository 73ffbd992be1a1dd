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

"""Pictures of docs/tour.md, made from the code they show; `make docs` runs this.

Those of the demo come from what `make demo` has left in a folder: ``python docs/pictures.py --demo demo`` (chromium).
Those of docs/gap.md take a diagnosis, about a minute: ``python docs/pictures.py gap``; the one of the live diagnosis:
``python docs/pictures.py live``.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import gap_pictures
import matplotlib as mpl
import numpy as np
from live_pictures import draw_live
from matplotlib.figure import Figure

from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.excitation import hold, sine, steps, triangle
from piezo_hysteresis.report.figures.style import SETTINGS, canvas
from piezo_hysteresis.report.palette import BLACK, BLUE, GREEN, ORANGE
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

IMAGES = Path(__file__).parent / "images"
LIMITS = DriveLimits()


def what_a_stage_does() -> Figure:
    """Loops that depend on amplitude and on frequency, and creep: three reasons why volts are not micrometres."""
    stage = SimulatedStage(PlantParameters().with_values({"creep.gamma": 0.015}), seed=1)
    figure, ((loops, rate, creep),) = canvas(1, 3, 3.0)

    record = stage.play(triangle(LIMITS, (1.0, 0.7, 0.4), 1.0), average=10)
    loops.plot(record.voltage, record.displacement * 1e6, color=BLACK, linewidth=1.0)
    loops.set(title="hysteresis", xlabel="drive u [V]", ylabel="displacement y [µm]")

    for frequency, colour in ((1.0, BLUE), (100.0, GREEN), (400.0, ORANGE)):
        record = stage.play(sine(LIMITS, frequency, 3.0 / frequency))
        last = slice(-round(1.0 / frequency / record.sample_period) - 1, None)
        rate.plot(record.voltage[last], record.displacement[last] * 1e6, color=colour, label=f"{frequency:g} Hz")
    rate.set(title="rate dependence", xlabel="drive u [V]", ylabel="displacement y [µm]")
    rate.legend()

    record = stage.play(np.concatenate([hold(LIMITS, 0.0, 0.1), steps(LIMITS, (0.0, 0.5), 10.0)])[5000:], average=500)
    onset = int(np.argmax(record.voltage > 4.9)) + 1
    time = record.sample_period * np.arange(record.size - onset)
    creep.semilogx(time[1:], record.displacement[onset + 1 :] * 1e6, color=BLACK, linewidth=1.0)
    creep.set(title="creep after a step to 5 V", xlabel="time since the step [s]", ylabel="displacement y [µm]")
    return figure


PAPER = ("table_1", "figure_5", "figure_8")
"""Exhibits of examples/paper that the tour shows."""


SCREEN = "1000,1150"
"""Width and height of the page as it is shown [px]."""


def of_the_demo(folder: Path) -> None:
    """The live run, the scan, and the beginning of its page as a browser shows it."""
    for name in ("residual", "scan"):
        (IMAGES / f"demo_{name}.png").write_bytes((folder / f"{name}.png").read_bytes())
    with tempfile.TemporaryDirectory() as profile:
        browser = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        shown = [f"--user-data-dir={profile}", f"--window-size={SCREEN}", f"--screenshot={IMAGES / 'report.png'}"]
        subprocess.run([*browser, *shown, (folder / "report.html").resolve().as_uri()], check=True)


def main() -> None:
    """Draw all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--demo", type=Path, metavar="FOLDER", help="only those of the demo that wrote this folder")
    parser.add_argument("page", nargs="?", choices=("gap", "live"), help="only the pictures of this page")
    options = parser.parse_args()
    IMAGES.mkdir(exist_ok=True)
    if options.demo is not None:
        of_the_demo(options.demo)
        return
    if options.page == "gap":
        gap_pictures.main(IMAGES)
        return
    if options.page == "live":
        draw_live(IMAGES)
        return
    with mpl.rc_context(SETTINGS):
        what_a_stage_does().savefig(IMAGES / "what_a_stage_does.png", dpi=110, metadata={"Software": None})
    scripts = IMAGES.parents[1] / "examples" / "paper"
    with tempfile.TemporaryDirectory() as folder:
        for name in PAPER:
            subprocess.run([sys.executable, scripts / f"{name}.py", "-o", folder], check=True)
            (IMAGES / f"{name}.png").write_bytes((Path(folder) / f"{name}.png").read_bytes())


if __name__ == "__main__":
    main()
