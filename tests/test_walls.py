"""The walls of the house are not paint: each kind of forbidden arrow, drawn into the import graph, breaks a contract."""

from __future__ import annotations

from copy import deepcopy
from importlib import import_module
from pathlib import Path

import grimp
import pytest
from importlinter.application.use_cases import read_user_options
from importlinter.configuration import configure

configure()
OPTIONS = read_user_options(str(Path(__file__).parents[1] / "pyproject.toml"))
CLASSES = {
    "layers": "LayersContract",
    "forbidden": "ForbiddenContract",
    "independence": "IndependenceContract",
    "protected": "ProtectedContract",
    "acyclic_siblings": "AcyclicSiblingsContract",
}
ROOMS = "the rooms of the diagnosis, none looking back"
LOOP = "a loop's plug-ins know nothing of the run they take part in"


@pytest.fixture(scope="module")
def house():
    return grimp.build_graph("simbench", "detectors", "scenarios", include_external_packages=True, cache_dir=None)


def broken(graph):
    """Return the names of the contracts that a graph breaks."""
    out = set()
    for options in OPTIONS.contracts_options:
        kind = import_module(f"importlinter.contracts.{options['type']}")
        contract = getattr(kind, CLASSES[options["type"]])(options["name"], OPTIONS.session_options, options)
        if not contract.check(graph=deepcopy(graph), verbose=False).kept:
            out.add(options["name"])
    return out


def test_the_house_as_it_stands_breaks_no_wall(house):
    assert broken(house) == set()


@pytest.mark.parametrize(
    ("importer", "imported", "wall"),
    [
        ("simbench.gap.sensor.samples", "simbench.gap.decide.assess", ROOMS),
        ("simbench.gap.likelihood.engine", "simbench.gap.situation", ROOMS),
        ("simbench.gap.likelihood.model", "simbench.gap.likelihood.engine", "no circle in the whole house"),
        ("simbench.loop.disturbance", "simbench.loop.simulate", "no circle in the whole house"),
        (
            "simbench.loop.effects.stiction",
            "simbench.loop.setup",
            "a loop's plug-ins know nothing of the run they take part in",
        ),
        ("simbench.loop.setup", "simbench.gap.situation", "rooms stand above what they use"),
        ("simbench.blind.worlds.own.loops", "simbench.loop.valves.choudhury", "rooms stand above what they use"),
        ("simbench.blind.score", "simbench.gap.report.result", "rooms stand above what they use"),
        ("simbench.blind.claims", "detectors.signal.oscillation", "the blind check asks no detector"),
        ("simbench.gap.decide.assess", "simbench.blind.score", "only the command line knows the blind check"),
        ("simbench.bench.execute.run", "simbench.blind.making", "only the command line knows the blind check"),
        ("detectors.quality", "simbench.loop.plant", "detectors is usable alone"),
    ],
)
def test_a_forbidden_arrow_breaks_its_wall(house, importer, imported, wall):
    graph = deepcopy(house)
    graph.add_import(importer=importer, imported=imported)
    assert wall in broken(graph)


@pytest.mark.parametrize("module", ["simbench.gap.attic", "simbench.attic", "simbench.loop.attic"])
def test_a_module_without_a_place_breaks_the_order_of_rooms(house, module):
    graph = deepcopy(house)
    graph.add_module(module)
    assert broken(graph)
