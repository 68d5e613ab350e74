"""Test records: what is read of them, and the sentence with which an unfit one is refused."""

import numpy as np
import pytest

from simbench.detectors.errors import UserError
from simbench.gap.intake.recorded_test import TEST_IDS, files_of, read_test
from simbench.gap.planning.order import ORDER
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table({
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 2.0, "Ti": 10.0},
    "sampling": {"Ts": 1.0, "n": 100},
})  # fmt: skip


def write(place, *, n=100, mode=None, lab=None, Ts=1.0, settings="", op=None):
    rng = np.random.default_rng(1)
    columns = {
        "t": Ts * np.arange(n),
        "sp": np.full(n, 5.0),
        "op": 50 + rng.standard_normal(n) if op is None else op,
    }
    columns["pv"] = 5 + rng.standard_normal(n)
    names, rows = list(columns), [list(map(str, row)) for row in zip(*columns.values())]
    for name, values in (("mode", mode), ("lab", lab)):
        if values is not None:
            names.append(name)
            rows = [[*row, str(v)] for row, v in zip(rows, values)]
    (place / "test.csv").write_text(
        "\n".join([",".join(names), *(",".join(r) for r in rows)]) + "\n"
    )
    if settings:
        (place / "test.toml").write_text(settings)
    return str(place / "test.csv")


def test_settings_next_to_a_record_belong_to_it_and_a_loop_file_of_that_name_is_not(tmp_path):
    file = write(tmp_path, settings="[test]\nid = 'kc_half'\n[controller]\nKc_ratio = 0.5\n")
    test = read_test(file, LOOP)
    assert (test.id, test.loop.controller.Kc, test.loop.controller.Ti) == ("kc_half", 1.0, 10.0)
    assert read_test(f"{file}:{tmp_path / 'test.toml'}", LOOP).id == "kc_half"
    (tmp_path / "test.toml").write_text(LOOP.to_toml())
    assert read_test(file, LOOP).settings == {}
    assert files_of("a.csv:b.toml") == ("a.csv", "b.toml")
    assert files_of("a.csv") == ("a.csv", "")


def test_mode_shows_where_op_is_the_operators_and_lab_samples_are_few(tmp_path):
    file = write(
        tmp_path, mode=["AUTO"] * 60 + ["man"] * 30 + ["CAS"] * 10, lab=[""] * 99 + ["5.5"]
    )
    test = read_test(file, LOOP)
    assert test.manual.sum() == 30
    assert test.manual[60]
    assert not test.manual[90]
    assert np.isfinite(test.lab).sum() == 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"n": 30, "op": np.arange(30.0)}, "at least 40"),
        ({"op": np.full(100, 50.0)}, "OP is constant (50) in AUTO"),
        ({"lab": ["x"] * 100}, "lab holds text"),
        ({"Ts": 2.0}, "a log of another pace is declared by Ts"),
        ({"settings": "[test]\nid = 'bumb'\n"}, "did you mean 'bump'?"),
        ({"settings": "[tets]\nid = 'bump'\n"}, "[tets] is no table"),
        (
            {"settings": "[controller]\nKc_ratio = -1\n"},
            "controller.Kc_ratio = -1; a number above 0 is needed",
        ),
        ({"settings": "[controller]\nKq = 1\n"}, "controller.Kq is unknown"),
        ({"settings": "[test]\nid = 'bump'\n"}, "no row of a column `mode` says MAN"),
        ({"settings": "[test]\nid = 'mv'\n"}, "it has no column mv"),
        ({"settings": "[test]\nid = 'lab'\n"}, "it has 0 samples in column lab"),
        (
            {"settings": "[test]\nid = 'lab'\n", "lab": [""] * 97 + ["5"] * 3},
            "3 samples in column lab; at least 8",
        ),
        ({"settings": "[test]\nlab_std = 'x'\n"}, "test.lab_std = 'x'"),
        ({"settings": "[sampling]\nTs = 5.0\n"}, "its [sampling] says 5 s"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_sentence(tmp_path, given, message):
    with pytest.raises(UserError) as error:
        read_test(write(tmp_path, **given), LOOP)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_log_of_another_pace_is_taken_where_it_is_declared(tmp_path):
    test = read_test(write(tmp_path, Ts=0.25, settings="[sampling]\nTs = 0.25\n"), LOOP)
    assert (test.record.Ts, test.loop.sampling.Ts) == (0.25, 0.25)


def test_every_test_that_is_recommended_can_be_read():
    assert set(ORDER) < set(TEST_IDS)


def test_lab_samples_keep_their_time_where_rows_were_lost(tmp_path):
    lab = ["" if k % 10 else str(k) for k in range(100)]
    file = write(tmp_path, lab=lab)
    lines = (tmp_path / "test.csv").read_text().splitlines()
    # rows 25, 26 and 71 never reached the archive
    kept = [line for k, line in enumerate(lines[1:]) if k not in (25, 26, 71)]
    (tmp_path / "test.csv").write_text("\n".join([lines[0], *kept]) + "\n")
    test = read_test(file, LOOP)
    assert test.record.n == 100
    assert test.lab[::10].tolist() == list(range(0, 100, 10))
    assert np.isfinite(test.lab).sum() == 10
