"""Dense loops judged at other densities and backwards: two that once changed their verdicts."""

from itertools import islice

import pytest

from detectors.contract.detector import THINNED, backwards
from detectors.judge import judge
from detectors.prepared import prepare, thinned
from results.studies.invariance import dense_records


@pytest.fixture(scope="module")
def records():
    """Loops of chapter whose whole does not oscillate: a half does, at some densities more plainly
    than at others.
    """
    found = list(islice(dense_records({"chapter": 20}), 12))
    return [found[9].without_mv(), found[11].without_mv()]


def test_a_half_oscillates_at_every_density_or_at_none(records):
    for record in records:
        found = [prepare(thinned(record, k)).oscillation.sustained for k in (1, *THINNED[:2])]
        assert len(set(found)) == 1


def test_verdicts_do_not_hang_on_the_density(records):
    for record in records:
        said = [
            [v.verdict for v in judge(thinned(record, k), ["horch_histogram", "ellipse"])]
            for k in (1, *THINNED[:2])
        ]
        assert said[0] == said[1] == said[2]


def test_a_method_that_reads_both_ways_says_the_same_backwards(records):
    how = {"raw": True, "halves": False}
    for record in records:
        one, other = (
            judge(r, ["horch", "ellipse", "horch_histogram"], **how)
            for r in (record, backwards(record))
        )
        assert [v.verdict for v in one] == [v.verdict for v in other]
