"""Grids: counts, order, overrides, and one sentence for every grid that cannot be."""

import json
import math
from importlib.resources import files
from pathlib import Path

import pytest

from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import (
    SMALLEST_BLOCK,
    SMALLEST_LOOP,
    load_grid,
    make_grid,
    packaged_grid,
)
from simbench.scenarios.grid_file import GridFile
from simbench.scenarios.packaged import grid_names

PLAIN = {
    "title": "one loop",
    "loop": {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "valve": {"model": "choudhury", "S": 5, "J": 2},
        "sampling": {"Ts": 1, "n": 500},
    },
    "axes": {"valve.J": [1, 2, 5], "noise.std": [0.0, 0.1]},
}


@pytest.mark.parametrize("name", [n for n in grid_names() if not packaged_grid(n).frozen])
def test_a_grid_of_the_package_which_is_read_unchecked_has_no_mistake(name):
    file = Path(str(files("simbench.scenarios") / "grids" / f"{name}.toml"))
    assert load_grid(file).hash == load_grid(name).hash


FEW = {"Td_over_T": [1.0], "S_over_2J": [1.0]}


def ruled(**changes):
    block = {
        "name": "b",
        "axes": {
            "Td_over_T": [0.2, 1.0],
            "S_over_2J": [0.5, math.inf],
            "noise_ratio": [0.0],
            "disturbance": ["none", "sine"],
        },
        "draw": {"K": [0.5, 2], "T": [5, 50], "S": 5, "samples_per_period": 40, "periods": 20},
        "member": [{"name": "sticky", "valve": "choudhury"}, {"name": "healthy", "valve": "ideal"}],
        **changes,
    }
    return {
        "title": "t",
        "disturbances": {"sine": {"type": "sine", "amplitude": 1, "period": [0.5, 2]}},
        "block": [block],
    }


@pytest.mark.parametrize("name", ["smoke", "table-11-3", "chapter", "own-ground", "ci", "plant"])
def test_every_grid_has_the_count_it_promises(name):
    grid = load_grid(name)
    assert len(grid) == grid.content.expected == sum(grid.size(i) for i in range(grid.group_count))
    assert grid.title
    assert grid.source


def test_table_11_3_has_all_eight_cells():
    blocks = load_grid("table-11-3").content.block
    cells = {(b.process, b.controller, math.inf in b.axes["S_over_2J"]) for b in blocks}
    assert len(cells) == 8


def test_siblings_share_plant_sampling_set_point_and_seed():
    for group in make_grid(ruled()).groups():
        sticky, healthy = (d.loop for d in group.drafts)
        assert (sticky.plant, sticky.sampling, sticky.setpoint) == (
            healthy.plant,
            healthy.sampling,
            healthy.setpoint,
        )
        assert group.twin.plant == sticky.plant


@pytest.mark.parametrize("name", ["chapter", "ci", "plant", "families", "own-ground"])
def test_a_pair_shares_every_number_but_the_seed_and_no_other_cell_has_them(name):
    seen, groups = [], list(load_grid(name).groups(0, 40))
    for group in groups:
        echoes = [draft for draft in group.drafts if draft.echo is not None]
        assert echoes
        for draft in echoes:
            of = draft.echo.of
            assert of in group.drafts
            assert of.echo is None
            assert draft.seed != of.seed
            assert draft.rules == of.rules
            for part in ("plant", "controller", "setpoint", "operating_point", "disturbance"):
                assert getattr(draft.loop, part) == getattr(of.loop, part)
        twin = group.twin
        seen.append((twin.plant.K, twin.controller.Kc, twin.setpoint.value))
    for numbers in zip(*seen, strict=True):
        assert len(set(numbers)) == len(groups)


@pytest.mark.parametrize(("where", "of", "message"), [
    ([0.5], None, "echo has no sibling"),
    ([0.5, 1.0], "nobody", "of 'nobody' is unknown, known: sticky"),
])  # fmt: skip
def test_an_echo_without_its_sticky_sibling_is_one_sentence(where, of, message):
    sticky = {"name": "sticky", "valve": "choudhury", "where": {"S_over_2J": where}}
    echo = {"name": "healthy", "valve": "ideal", "echo": "smooth", **({"of": of} if of else {})}
    table = ruled()
    (block,) = table["block"]
    block = block | {"axes": block["axes"] | {"S_over_2J": [0.5, 1.0]}, "member": [sticky, echo]}
    with pytest.raises(SpecError, match=message):
        make_grid({**table, "block": [block]})
    with pytest.raises(SpecError, match="the sticky member must come first"):
        make_grid({**table, "block": [block | {"member": [echo, sticky]}]})


def test_cells_that_differ_in_the_disturbance_alone_share_their_draws():
    calm, driven = make_grid(ruled()).groups(0, 2)
    assert calm.twin == driven.twin
    assert calm.rules == driven.rules
    assert calm.drafts[0].seed != driven.drafts[0].seed


def test_more_repeats_only_append():
    once, twice = make_grid(ruled()), make_grid(ruled(), sets={"repeats": 2})
    assert len(twice) == 2 * len(once)
    assert all(once.group(i) == twice.group(i) for i in range(once.group_count))
    assert twice.group(once.group_count) != once.group(0)


def test_infinity_means_dead_band_and_zero_none():
    group = make_grid(ruled()).group(2)
    assert [d.loop.valve.name for d in group.drafts] == ["deadband", "ideal"]
    assert [d.tags["S_over_2J"] for d in group.drafts] == [math.inf, 0.0]


def test_a_dotted_key_is_set_in_every_loop_that_has_it():
    grid = make_grid(ruled(), sets={"valve.S": 3.0, "controller.Kc": 0.5})
    for group in grid.groups():
        assert group.twin.valve.parameters["S"] == 3.0
        assert {d.loop.controller.Kc for d in group.drafts} == {0.5}


def test_the_hash_follows_what_is_simulated_and_nothing_else():
    grid = make_grid(ruled())
    assert make_grid({**ruled(), "title": "another"}).hash == grid.hash
    for sets in ({"seed": 4}, {"repeats": 3}, {"noise_ratio": 0.5}, {"controller.Kc": 2.0}):
        assert make_grid(ruled(), sets=sets).hash != grid.hash


@pytest.mark.parametrize(
    ("table", "sets", "axes", "words"),
    [
        (ruled(axes={"Td_over_TT": [1]}), {}, {}, "Td_over_T"),
        (ruled(member=[{"name": "x", "valv": "ideal"}]), {}, {}, "valve"),
        (ruled(tuning="slow"), {}, {}, "tuning"),
        (
            ruled(member=[{"name": "x", "valve": "ideal", "where": {"S": [1]}}]),
            {},
            {},
            "none of its axes",
        ),
        (ruled(), {"noise_rato": 1}, {}, "noise_ratio"),
        (ruled(), {"valv.S": 1}, {}, "valv.S"),
        (ruled(), {}, {"tunin": ["slow"]}, "tuning"),
        (ruled(), {}, {"tuning": []}, "no value"),
        ({**ruled(), "expected": 99}, {}, {}, "expected = 99"),
        ({"title": "neither"}, {}, {}, "either"),
        (PLAIN, {"repeats": 0}, {}, "repeats"),
        (ruled(), {}, {"S_over_2J": ["a"]}, "'a'; numbers are needed"),
        (ruled(axes=FEW | {"tuning": ["same"]}), {}, {"tuning": [1.0]}, "words are needed"),
        (ruled(), {}, {"S_over_2J": [0.0]}, "1e-06 to inf is allowed"),
        (ruled(), {}, {"disturbance": ["sin"]}, "sine"),
        (ruled(axes=FEW | {"tuning": ["tihgt"]}), {}, {}, "tight"),
        (ruled(axes=FEW | {"excitation": ["kick"]}), {}, {}, "excitation"),
        (ruled(axes={"S_over_2J": [1.0]}), {}, {}, "Td_over_T is needed"),
        ({**PLAIN, "axes": {"noise": [0.1]}}, {}, {}, "key 'noise' = 0.1 is a section: a table is"),
        ({**PLAIN, "axes": {"valv.J": [1]}}, {}, {}, "no section 'valv', did you mean 'valve'"),
    ],
)
def test_a_wrong_grid_is_one_sentence(table, sets, axes, words):
    with pytest.raises(SpecError, match=words) as error:
        make_grid(table, "g", sets, axes).group(0)
    assert "\n" not in str(error.value)


def test_an_unknown_grid_names_the_nearest():
    with pytest.raises(SpecError, match="chapter"):
        load_grid("chaptr")
    assert set(grid_names()) == {
        "smoke",
        "table-11-3",
        "chapter",
        "own-ground",
        "ci",
        "plant",
        "families",
        "recorded",
    }


@pytest.mark.parametrize("text", [SMALLEST_LOOP, SMALLEST_BLOCK])
def test_the_smallest_grid_that_a_refusal_shows_works(tmp_path, text):
    (tmp_path / "mine.toml").write_text(text)
    assert len(load_grid(tmp_path / "mine.toml")) == 1


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("title = 'x'", True),
        ("[[block]]\nname = 'a'", False),
        (SMALLEST_LOOP + "\nrepaets = 2", False),
    ],
)
def test_a_file_without_loops_is_shown_the_smallest_grids(tmp_path, text, shown):
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(SpecError) as refused:
        load_grid(tmp_path / "mine.toml")
    for smallest in (SMALLEST_LOOP, SMALLEST_BLOCK):
        assert (smallest in str(refused.value)) == shown


@pytest.mark.parametrize("name", grid_names())
def test_what_a_manifest_keeps_of_a_grid_is_the_grid(name):
    content = load_grid(name).content
    kept = json.loads(json.dumps(content.model_dump(mode="json")))
    assert GridFile.model_validate(kept) == content
