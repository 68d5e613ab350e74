"""Gaps of hours, the hour that clocks lose in spring, the leap second, and values that carry the
mark of a bad sample.
"""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from simbench.cli import main
from simbench.detectors.errors import ParameterError, RecordError
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.bicoherence import bicoherence

N = 600
OP = 50.0 + 4.0 * np.sin(np.arange(N) / 5.0) + 0.01 * np.arange(N) % 0.07
PV = 20.0 + np.sin(np.arange(N) / 5.0 - 1.0) + 0.01 * (np.arange(N) * 7 % 11)


def write(path, times, pv=PV):
    lines = [
        f"{t},{op:.4f},{p if isinstance(p, str) else f'{p:.4f}'}" for t, op, p in zip(times, OP, pv)
    ]
    path.write_text("\n".join(["time,OP,PV", *lines]) + "\n")
    return path


def stamps(start, zone=UTC, hours_after=0, step=1):
    times = [
        start + timedelta(seconds=step * k + 3600 * hours_after * (k >= 400)) for k in range(N)
    ]
    return [t.astimezone(zone).strftime("%Y-%m-%d %H:%M:%S") for t in times]


BERLIN = ZoneInfo("Europe/Berlin")
SPRING = stamps(datetime(2024, 3, 31, 0, 55, tzinfo=UTC), BERLIN)
AUTUMN = stamps(datetime(2024, 10, 27, 0, 55, tzinfo=UTC), BERLIN)


@pytest.mark.parametrize(
    ("times", "message"),
    [(SPRING, "local time jumps by an hour"), (AUTUMN, "local time is set back by an hour")],
)
def test_the_command_proposed_for_a_clock_change_reads_every_sample(
    tmp_path, capsys, times, message
):
    file = write(tmp_path / "rec.csv", times)
    words = ["detect", str(file), "--method", "horch"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert message in error
    typed = error.strip().rpartition("; try: ")[2].split()
    assert typed[:2] == ["simbench", "detect"]
    assert main(typed[1:]) == 0
    assert np.allclose(read_record(file, Ts=1.0).pv, PV, atol=1e-4)


def test_a_long_record_is_told_that_its_clock_jumped(tmp_path):
    file = write(
        tmp_path / "rec.csv", stamps(datetime(2024, 3, 31, 0, 0, tzinfo=UTC), BERLIN, step=60)
    )
    assert any(
        "local time jumps by an hour" in note and "--ts 60" in note
        for note in read_record(file).notes
    )


def test_a_gap_of_hours_is_refused(tmp_path, capsys):
    file = write(
        tmp_path / "rec.csv", stamps(datetime(2024, 5, 1, 8, 7, tzinfo=UTC), hours_after=3)
    )
    assert main(["detect", str(file), "--method", "horch"]) == 2
    assert "samples are missing; at most 20% may be" in capsys.readouterr().err


@pytest.mark.parametrize("exponent", [-190, 190])
def test_bicoherence_is_the_same_whatever_the_unit_of_the_signal(exponent):
    x = np.random.default_rng(1).standard_normal(600) ** 3
    assert np.array_equal(bicoherence(np.ldexp(x, exponent)).bic2, bicoherence(x).bic2)


ORDERS = {
    "shuffled": np.random.default_rng(0).permutation(N),
    "later half first": np.roll(np.arange(N), N // 2),
    "two rows swapped": np.r_[0:100, 101, 100, 102:N],
}


@pytest.mark.parametrize("order", ORDERS)
def test_rows_out_of_order_are_never_to_be_counted_in_place_of_their_times(tmp_path, order):
    file = tmp_path / "rec.csv"
    head, *rows = write(file, np.arange(N)).read_text().splitlines()
    file.write_text("\n".join([head, *(rows[i] for i in ORDERS[order])]))
    with pytest.raises(RecordError, match=r"out of order; .*; sort them by time") as caught:
        read_record(file)
    assert caught.value.cure == ""


def test_an_export_that_overlaps_the_one_before_names_the_repeated_rows(tmp_path):
    file = tmp_path / "rec.csv"
    head, *rows = write(file, np.arange(N)).read_text().splitlines()
    file.write_text("\n".join([head, *rows[:300], *rows[200:]]))
    with pytest.raises(RecordError, match=r"rows are repeated; .*; remove") as caught:
        read_record(file)
    assert caught.value.cure == ""


def uneven(path, times, op, pv):
    rows = [f"{t:.4f},{o:.6f},{p:.6f}" for t, o, p in zip(times, op, pv, strict=True)]
    path.write_text("\n".join(["t,op,pv", *rows]) + "\n")
    return path


def test_samples_at_uneven_times_are_put_on_an_even_grid_by_the_command_that_is_proposed(tmp_path):
    kept = np.sort(np.random.default_rng(1).choice(1500, 900, replace=False)).astype(float)
    op, pv = 50 + np.sin(kept / 20), 20 + np.cos(kept / 20)
    file = uneven(tmp_path / "rec.csv", kept, op, pv)
    with pytest.raises(RecordError, match="samples are missing") as refused:
        read_record(file)
    assert refused.value.cure == "--resample linear"
    linear = read_record(file, resample="linear")
    assert linear.Ts == 1.0
    assert np.allclose(linear.op, 50 + np.sin((kept[0] + linear.t) / 20), atol=0.05)
    assert any("900 samples at uneven times on a grid of 1 s" in note for note in linear.notes)
    held = read_record(file, resample="held", Ts=2.0)
    assert held.Ts == 2.0
    last = np.searchsorted(kept, kept[0] + held.t, side="right") - 1
    assert np.allclose(held.pv, pv[last], atol=1e-5)
    with pytest.raises(ParameterError, match="did you mean 'linear'"):
        read_record(file, resample="linea")


def test_of_rows_with_equal_times_and_other_values_the_last_holds(tmp_path):
    times = np.sort(np.random.default_rng(2).choice([*range(0, 900, 3), *range(200)], 420))
    values = np.arange(420.0) % 17
    file = uneven(tmp_path / "rec.csv", times, values, 2 * values)
    with pytest.raises(RecordError, match="does not rise") as refused:
        read_record(file)
    assert refused.value.cure == "--resample held"
    record = read_record(file, resample="held")
    last = np.searchsorted(times, times[0] + record.t, side="right") - 1
    assert np.allclose(record.op, values[last])
