"""The files in config/ give every parameter of a node its default, no more and no fewer."""

from pathlib import Path

import pytest

from piezo_hysteresis.model.parameter_file import parameters
from piezo_hysteresis.nodes.identification.identification_node import IDENTIFICATION
from piezo_hysteresis.nodes.model.model_node import MODEL

CONFIG = Path(__file__).parents[2] / "config"


@pytest.mark.parametrize(("file", "rows"), [("model.yaml", MODEL), ("identification.yaml", IDENTIFICATION)])
def test_config_files_hold_the_defaults(file, rows):
    assert parameters((CONFIG / file).read_text()) == {"/**": {row.name: row.value for row in rows}}
