"""Rules of the methods: their published numbers, and on which side of a bound a loop on the bound
falls.
"""

from dataclasses import replace

import pytest

from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared

# method: threshold, as printed; Jelali (2013), chapter 11, unless the source says otherwise
PUBLISHED = {
    "he": {"eta_low": 0.4, "eta_high": 0.6},  # Eq 11.13
    "horch": {"dtau_low": 1 / 3, "dtau_high": 2 / 3, "drho_low": 0.0718, "drho_high": 1 / 3},
    "bicoherence": {"ngi_low": 0.001, "nli_low": 0.01},
    "choudhury": {"ngi_low": 0.001, "nli_low": 0.01},
    "rossi_scali": {"bound": 0.21},  # (1 - 0.66) / (1 + 0.66), rounded up
    "yamashita": {"rho3_min": 0.25, "step": 1},
    "singhal_salsbury": {"R_low": 1.0},
    "surrogate": {"npi_low": 1.0},
    "gbt44693": {"ratio_low": 0.3},  # of open implementations; the standard was not seen
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_numbers(name):
    has = methods.load(name).METHOD.thresholds
    for key, value in PUBLISHED[name].items():
        assert has[key].default == pytest.approx(value, abs=1e-4), key


@pytest.fixture(scope="module")
def sticky(loop):
    """Flow-like: PV stands for MV where a method wants it."""
    return Prepared(replace(loop(J=2.5, kick=6.0, n=1500, noise=0.02), kind="flow"))


# method, where the number stands, threshold on it, other thresholds, answers just below, on and
# just above the number
ABOVE, AT = "above the bound", "at the bound"
RULES = [
    ("ellipse", "fitness", "fitness_low", {}, AT),
    ("he", "eta", "eta_high", {}, AT),
    ("hammerstein", "score", "score_high", {"score_low": -0.01, "S_low": 0.0}, AT),
    ("stenman", "score", "score_high", {"score_low": -0.01}, AT),
    ("horch_isaksson", "score", "score_high", {"score_low": -0.01}, AT),
    ("horch", "dtau", "dtau_high", {"drho_high": -1.0}, AT),
    ("horch", "drho", "drho_high", {"dtau_high": -1.0}, AT),
    ("gbt44693", "axis_ratio", "ratio_low", {}, ABOVE),
    ("yamashita", "rho3", "rho3_min", {}, ABOVE),
    ("singhal_salsbury", "r_area", "R_low", {}, ABOVE),
    ("surrogate", "npi", "npi_low", {}, ABOVE),
    ("kano_a", "stuck_share", "share_min", {}, ABOVE),
    ("kano_b", "width", "width_min", {"still_min": -1.0}, ABOVE),
    ("kano_b", "still", "still_min", {"width_min": -1.0}, ABOVE),
    ("rossi_scali", "eta_rossi", "bound", {}, ABOVE),
    ("horch_histogram", "score", "bound", {}, ABOVE),
    ("procedure", "score", "odds_high", {"odds_low": -50.0}, AT),
]


def around(prepared, name, index, threshold, others):
    """Return the verdicts with a threshold just below, at and just above the number of a loop."""
    module = methods.load(name)
    chosen = {**module.METHOD.defaults(), **others}
    first = module.detect(prepared, **chosen)
    value = first.score if index == "score" else first.indices[index]
    tiny = 1e-9 * max(abs(value), 1.0)
    return [
        module.detect(prepared, **{**chosen, threshold: value + d}).verdict
        for d in (-tiny, 0.0, tiny)
    ]


@pytest.mark.parametrize(("name", "index", "threshold", "others", "side"), RULES)
def test_a_loop_on_the_bound(sticky, name, index, threshold, others, side):
    verdicts = around(sticky, name, index, threshold, others)
    assert [v == "stiction" for v in verdicts] == [True, side == AT, False]


@pytest.mark.parametrize(
    ("name", "index", "threshold", "others"),
    [
        ("he", "eta", "eta_low", {"eta_high": 2.0}),
        ("hammerstein", "score", "score_low", {"score_high": 2.0, "S_low": 0.0}),
        ("stenman", "score", "score_low", {"score_high": 2.0}),
        ("horch_isaksson", "score", "score_low", {"score_high": 2.0}),
        ("procedure", "score", "odds_low", {"odds_high": 99.0}),
    ],
)
def test_between_two_bounds_nothing_is_decided_and_below_the_lower_one_it_is_no_stiction(
    sticky, name, index, threshold, others
):
    verdicts = around(sticky, name, index, threshold, others)
    assert verdicts == ["no_decision", "no_stiction", "no_stiction"]
