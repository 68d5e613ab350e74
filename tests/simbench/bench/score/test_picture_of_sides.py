"""The picture of a ranking: what each method says of sticky and of other loops, the whole of
each.
"""

import numpy as np
import pytest

from simbench.bench.score.picture import sides
from simbench.bench.score.scoring import score_book


def test_each_bar_is_the_whole_and_begins_with_what_is_right(book, noisy):
    rng, truth = np.random.default_rng(0), np.arange(400) % 2
    verdict = np.where(rng.random((3, 400)) < 0.2, 2, noisy(rng, truth, 0.8)[0])
    scores = score_book(book(verdict, truth, methods=("one", "two", "three")))
    rows = scores.rows()
    left, right = sides(rows).figure.axes[:2]
    methods = rows[rows.kind < 2]
    assert [label.get_text() for label in left.get_yticklabels()] == methods.method.tolist()
    for axes, first in ((left, methods.sensitivity), (right, None)):
        widths = np.array([[bar.get_width() for bar in part] for part in axes.containers[:3]])
        assert widths.sum(axis=0) == pytest.approx(np.ones(3))
        if first is not None:
            assert widths[0] == pytest.approx(first.to_numpy())
        else:
            assert widths[2] == pytest.approx(methods.false_positives.to_numpy())
