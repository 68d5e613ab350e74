import numpy as np

from simbench.cli.valve_table import valve_file
from simbench.loop.response import valve_response


def test_every_position_reads_back_to_the_same_bits_and_other_columns_stay(tmp_path):
    op = 50 + 10 * np.sin(np.arange(200) / 7)
    rows = "".join(f"{0.25 * k!r};{u!r};FIC{k}\n" for k, u in enumerate(op.tolist()))
    (tmp_path / "in.csv").write_text("T_s;OP;tag\n" + rows)
    valve_file(tmp_path / "in.csv", tmp_path / "out.csv", "coulomb", {"S": 5, "J": 2})
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert lines[0] == "T_s,OP,tag,mv"
    assert lines[8].startswith("1.75,")
    assert lines[8].split(",")[2] == "FIC7"
    mv = [float(line.split(",")[-1]) for line in lines[1:]]
    np.testing.assert_array_equal(mv, valve_response("coulomb", op, {"S": 5, "J": 2}, Ts=0.25))


def test_an_old_position_is_replaced_and_without_time_the_period_is_a_second(tmp_path):
    (tmp_path / "in.csv").write_text("mv,op\n1,20\n1,80\n1,80\n")
    valve_file(tmp_path / "in.csv", tmp_path / "out.csv", "lag", {"rate": 6})
    assert (tmp_path / "out.csv").read_text() == "op,mv\n20,20.0\n80,26.0\n80,32.0\n"
