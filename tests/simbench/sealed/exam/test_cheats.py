"""Fourteen ways to cheat in an exam of grid ci, and how often each is right.

Eight are of earlier rounds; somebody who had read only the public documentation wrote the others.
Each is judged on loops that oscillate and whose truth is clear. A cheat that learns does so on
another exam of the same grid, opened beforehand.

A cheat may be right on at most .60. Measured on two exams of 600 records, either learned from and
judged on the other (512 and 530 loops), and for siblings on a whole block of the grid (324 loops),
the cheats are right on at most .59, with three exceptions: `period_means` (.67), `regular_cycles`
(.71) and `regular_siblings` (.70). These know how regular the cycles are under noise, steps and a
random walk, which follows partly from friction. Siblings add nothing: they share no number by which
they could be known. The three miss the limit of .60; their tests only keep them below a ceiling
near what was measured.
"""

import hashlib
import re
import shutil
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.signal import hilbert

from simbench.bench.execute.plugin_host import settled
from simbench.bench.scenario.truth import YES, simulate_with_truth
from simbench.bench.score import no_waveform
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord
from simbench.scenarios.grid import load_grid
from simbench.sealed.exam.folder import Exam, read_exam
from simbench.sealed.exam.making import make_exam
from simbench.sealed.exam.opening import opened_exam

MOST_RIGHT = 0.60  # share of the judged loops that a cheat may answer correctly
NORMAL_95 = 1.645  # one-sided 95 % quantile of the normal distribution
RECORDS = 300  # of either exam: some 260 are judged, and the 95 % margin of a share of .60 is .05
EVERY_GROUP = 10  # the public grid is simulated at every tenth group: all of it takes minutes
EXPECTED_OP = 50.0  # % of OP


@dataclass(frozen=True)
class Sitting:
    """An exam with its truth; a cheat looks at the truth of the exam that it learns from only."""

    exam: Exam
    cycled: np.ndarray  # whether stiction makes the loop cycle, shape (n,)
    judged: np.ndarray  # whether a loop oscillates and its truth is clear, shape (n,)

    @property
    def records(self) -> list[LoopRecord]:
        """Return the records in the order of the exam."""
        return list(self.exam.records.values())

    @cached_property
    def periods(self) -> np.ndarray:
        """Return each record's period in samples, shape (n,); half its length without a period."""
        periods_s = [prepare(record).oscillation.period_s / record.Ts for record in self.records]
        return np.where(
            np.isfinite(periods_s), periods_s, [record.n / 2 for record in self.records]
        )

    @cached_property
    def levels(self) -> np.ndarray:
        """Return what each record shows without its waveform, shape (n, features)."""
        both = zip(self.records, self.periods)
        return np.array([no_waveform.features_without_waveform(r, p * r.Ts) for r, p in both])

    @cached_property
    def drifts(self) -> np.ndarray:
        """Return drift, variation over quarters and controller of each record, (n, features)."""
        return np.array([drift_of(r, p) for r, p in zip(self.records, self.periods)])

    @cached_property
    def regularity(self) -> np.ndarray:
        """Return how regular the cycles of OP and PV are, shape (n, features)."""
        both = zip(self.records, self.periods)
        return np.array([[*regularity_of(r.op, p), *regularity_of(r.pv, p)] for r, p in both])

    def columns(self, *names: str) -> np.ndarray:
        """Return features without waveform by their names, shape (n, names)."""
        return self.levels[:, [no_waveform.FEATURES.index(name) for name in names]]

    def right(self, answers: np.ndarray) -> tuple[float, int]:
        """Return the share of the judged loops that is answered correctly, and their number."""
        hits = (answers == self.cycled)[self.judged]
        return float(hits.mean()), hits.size


def sit(place: Path, grid: str | Path, n: int | None, seed: int) -> Sitting:
    """Make an exam in a new folder with its key in another, and open it."""
    make_exam(grid, place / "exam", place / "kept" / "key", n=n, seed=seed)
    return opened(place / "exam", place / "kept" / "key")


def opened(folder: Path, key: Path) -> Sitting:
    """Open an exam with answers that do not matter."""
    exam, answers = read_exam(folder), key.parent / "answers.csv"
    rows = [f"x,{name},stiction,\n" for name in exam.records]
    answers.write_text("".join(["method,record,verdict,score\n", *rows]))
    with opened_exam(folder, key, [answers]) as both:
        labels = both.labels
    judged = labels.oscillates.to_numpy(bool) & labels.cycled.isin(["yes", "no"]).to_numpy()
    return Sitting(exam, (labels.cycled == "yes").to_numpy(), judged)


def drift_of(record: LoopRecord, period: float) -> list[float]:
    """Return scatter over quarters and over periods (in samples), and the PI law's coefficients."""
    values, whole = [], max(min(round(period), record.n // 3), 2)  # three periods or more
    for x in (record.op, record.pv):
        quarters = np.array_split(x, 4)
        std = np.array([quarter.std() for quarter in quarters])
        means = x[: x.size // whole * whole].reshape(-1, whole).mean(axis=1) / x.std()
        steps = np.abs(np.diff(means))
        drift = np.std([quarter.mean() for quarter in quarters]) / x.std()
        values += [drift, std.std() / std.mean(), means.std(), steps.max(), np.median(steps)]
    error, moves = record.sp - record.pv, np.diff(record.op)
    gain, integral = np.linalg.lstsq(np.column_stack([np.diff(error), error[1:]]), moves)[0]
    return [*values, abs(gain), integral / gain, np.sign(gain), moves.std() / record.op.std()]


def regularity_of(x: np.ndarray, period: float) -> list[float]:
    """Return power in bands around the main line, and scatter of the amplitude and the phase."""
    z, line, k = x - x.mean(), x.size / period, np.arange(x.size // 2 + 1)
    power = np.abs(np.fft.rfft(z * np.hanning(x.size))) ** 2
    edges = np.array([0.0, 0.35, 0.7, 0.9, 1.1, 1.4, 1.8]) * line
    bands = np.array([power[(k >= a) & (k < b)].sum() for a, b in pairwise(edges)])
    narrow = np.where((k > 0.5 * line) & (k < 1.5 * line), np.fft.rfft(z), 0.0)
    margin = int(min(period, x.size / 6))
    wave = hilbert(np.fft.irfft(narrow, x.size))[margin : x.size - margin]
    size, phase, t = np.abs(wave), np.unwrap(np.angle(wave)), np.arange(wave.size)
    wander = phase - np.polyval(np.polyfit(t, phase, 1), t)
    jitter = np.diff(phase[:: max(int(period), 1)]).std()
    scatter = [size.std() / size.mean(), size.min() / size.mean(), wander.std(), jitter]
    return [*(bands / bands.sum()), *scatter]


def everything(of: Sitting) -> np.ndarray:
    """Return all features, shape (n, features)."""
    return np.hstack([of.levels, of.drifts, of.regularity])


def learned(features: Callable, learn: Sitting, judge: Sitting, depth: int = 0) -> np.ndarray:
    """Return probabilities of stiction by gradient boosting, or by one tree of a given depth."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.tree import DecisionTreeClassifier

    model = HistGradientBoostingClassifier(
        max_iter=150, learning_rate=0.07, max_leaf_nodes=8, min_samples_leaf=15
    )
    if depth:
        model = DecisionTreeClassifier(max_depth=depth, random_state=0)
    with np.errstate(divide="ignore", invalid="ignore"):  # a signal that stands still has std 0
        seen, new = (np.nan_to_num(features(of), posinf=0, neginf=0) for of in (learn, judge))
    model.fit(seen[learn.judged], learn.cycled[learn.judged])
    return model.predict_proba(new)[:, 1]


def guess(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Return for each record the answer that is more frequent in the exam that was opened."""
    return np.full(len(judge.records), learn.cycled[learn.judged].mean() > 0.5)


def look_up(book: dict[bytes, bool], learn: Sitting, judge: Sitting) -> np.ndarray:
    """Return the answer that a book holds for the bytes of PV, else the guess."""
    others = guess(learn, judge)
    return np.array([book.get(r.pv.tobytes(), other) for r, other in zip(judge.records, others)])


def simulated_book(grid: str, seed: int | None = None, every: int = 1, most: int | None = None):
    """Simulate a grid again, by default with its public seed: truth by the bytes of PV."""
    plan, book = load_grid(grid, {} if seed is None else {"seed": seed}), {}
    for index in range(0, plan.group_count, every)[:most]:
        for scenario, error in settled(plan.group(index)):
            if error is None:
                run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
                book[run.record.pv.tobytes()] = cycled.answer == YES
    return book


def numbers_in(folder: Path) -> list[int]:
    """Return every number in an exam's description, decimal or hexadecimal, as a grid's seed."""
    words = re.findall(r"\b[0-9a-f]+\b", (folder / "exam.json").read_text())
    numbers = [int(word, 10 if word.isdigit() else 16) for word in words]
    return sorted({number % 2**62 for number in numbers})


def key_within(folder: Path, wanted: str) -> Path | None:
    """Return the file in a folder whose SHA-256 is the commitment, if there is one."""
    candidates = [file for file in folder.rglob("*") if file.is_file()]
    matching = [f for f in candidates if hashlib.sha256(f.read_bytes()).hexdigest() == wanted]
    return matching[0] if matching else None


def op_band(learn: Sitting, judge: Sitting) -> np.ndarray:
    """A sticky valve swings OP by as much as the grid draws S, so two limits of std(OP) tell it."""
    std = np.array([record.op.std() for record in judge.records])
    return (std > 0.56) & (std < 7.8)


def op_place(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Sticky and healthy loops work at other values of OP, measured in the swing of OP."""

    def features(of: Sitting) -> np.ndarray:
        std, mean = of.columns("op_std", "op_mean").T
        return np.column_stack([std, np.abs(mean - EXPECTED_OP) / std])

    return learned(features, learn, judge, depth=3) > 0.5


def public_seed(learn: Sitting, judge: Sitting) -> np.ndarray:
    """The seed of the grid is public: simulate its records again and look them up."""
    return look_up(simulated_book("ci", every=EVERY_GROUP), learn, judge)


def seed_in_folder(learn: Sitting, judge: Sitting) -> np.ndarray:
    """A number in the exam's folder may be the seed, and a column too many may be the truth."""
    columns = pq.read_schema(judge.exam.file("records.parquet")).names
    assert columns == ["record", "t", "sp", "op", "pv"]
    book = {}
    for seed in numbers_in(judge.exam.folder):
        book |= simulated_book("ci", seed, every=EVERY_GROUP, most=2)
    return look_up(book, learn, judge)


def order_and_id(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Rows may stand in the order of the grid, and ids may count its scenarios."""

    def features(of: Sitting) -> np.ndarray:
        ids = np.array([int(name, 16) for name in of.exam.records])
        return np.column_stack([np.linspace(0, 1, ids.size), ids, ids % 2, ids % 16])

    return learned(features, learn, judge) > 0.5


def sampling(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Sampling time, length and number of periods may be drawn otherwise for healthy loops."""
    names = no_waveform.FEATURE_SETS["sampling"]
    return learned(lambda of: of.columns(*names), learn, judge) > 0.5


def noise_level(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Noise may be scaled to another swing in sticky loops than in healthy ones."""
    names = no_waveform.FEATURE_SETS["noise level"]
    return learned(lambda of: of.columns(*names), learn, judge) > 0.5


def start_and_growth(learn: Sitting, judge: Sitting) -> np.ndarray:
    """A simulation that starts at rest, or whose oscillation still grows, may be of one kind."""
    names = [n for key in ("offset and start", "growth") for n in no_waveform.FEATURE_SETS[key]]
    return learned(lambda of: of.columns(*names), learn, judge) > 0.5


def levels(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Levels, amplitudes, start values, noise and growth may tell together what none does alone."""
    return learned(lambda of: of.levels, learn, judge) > 0.5


def period_means(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Drift from period to period, variation over quarters and controller settings tell more."""
    return learned(lambda of: np.hstack([of.levels, of.drifts]), learn, judge) > 0.5


def regular_cycles(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Phase jitter, scatter of the amplitude and power near the main line show what drives it."""
    return learned(everything, learn, judge) > 0.5


def siblings(learn: Sitting, judge: Sitting, features=lambda of: of.levels) -> np.ndarray:
    """Of the loops of one group, known by set point, the one that looks stickiest is sticky."""
    chance, group = learned(features, learn, judge), defaultdict(list)
    for record, p in zip(judge.records, chance):
        group[record.sp[0]].append(p)
    alike = [group[record.sp[0]] for record in judge.records]
    return np.array([p == max(ps) if len(ps) > 1 else p > 0.5 for p, ps in zip(chance, alike)])


def regular_siblings(learn: Sitting, judge: Sitting) -> np.ndarray:
    """Of the loops of one group, the one whose cycles look stickiest is sticky."""
    return siblings(learn, judge, everything)


def key_by_commitment(learn: Sitting, judge: Sitting) -> np.ndarray:
    """The key is the file whose SHA-256 the exam publishes, if the key is within reach."""
    key = key_within(judge.exam.folder, judge.exam.about["commitment"])
    return guess(learn, judge) if key is None else opened(judge.exam.folder, key).cycled


def memory(learn: Sitting, judge: Sitting) -> np.ndarray:
    """A record seen before keeps its answer; any other gets that of the most similar one seen."""
    both = np.vstack([learn.levels, judge.levels])
    scaled = (both - both.mean(axis=0)) / np.maximum(both.std(axis=0), 1e-12)
    seen, new = scaled[: len(learn.levels)][learn.judged], scaled[len(learn.levels) :]
    nearest = [np.argmin(((seen - one) ** 2).sum(axis=1)) for one in new]
    similar = learn.cycled[learn.judged][nearest]
    known = {record.pv.tobytes(): cycled for record, cycled in zip(learn.records, learn.cycled)}
    return np.array([known.get(r.pv.tobytes(), s) for r, s in zip(judge.records, similar)])


EARLIER = [
    op_band, op_place, public_seed, seed_in_folder, order_and_id, sampling, noise_level,
    start_and_growth,
]  # fmt: skip
NEW = [levels, period_means, regular_cycles, key_by_commitment, memory]
IN_GROUPS = [siblings, regular_siblings]  # one cheat with two sets of features
# above .60: they know how regular cycles are, which no matching of amplitudes removes
CEILING = {period_means: 0.69, regular_cycles: 0.76, regular_siblings: 0.76}


def assert_right_no_more_often_than_allowed(cheat: Callable, learn: Sitting, judge: Sitting):
    share, n = judge.right(cheat(learn, judge))
    margin = NORMAL_95 * (MOST_RIGHT * (1.0 - MOST_RIGHT) / n) ** 0.5
    most = CEILING.get(cheat, MOST_RIGHT + margin)
    assert share <= most, f"right on {share:.3f} of {n} loops; at most {most:.3f} is allowed"


@pytest.fixture(scope="module")
def learn(tmp_path_factory):
    """An exam of grid ci to learn from."""
    return sit(tmp_path_factory.mktemp("learn"), "ci", RECORDS, 101)


@pytest.fixture(scope="module")
def judge(tmp_path_factory):
    """An exam of grid ci to judge on; it takes no two loops of a group."""
    return sit(tmp_path_factory.mktemp("judge"), "ci", RECORDS, 202)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An exam of all loops of the first block of grid ci, without repeats."""
    place = tmp_path_factory.mktemp("whole")
    text = (files("simbench.scenarios") / "grids" / "ci.toml").read_text()
    head, block, *_ = text.split("[[block]]")
    head = re.sub(r"expected = \d+\n", "", head.replace("repeats = 2", "repeats = 1"))
    (place / "ci.toml").write_text(f"{head}[[block]]{block}")
    return sit(place, place / "ci.toml", None, 404)


@pytest.mark.slow
@pytest.mark.parametrize("cheat", [*EARLIER, *NEW], ids=lambda cheat: cheat.__name__)
def test_a_cheat_is_right_no_more_often_than_allowed(learn, judge, cheat):
    assert judge.judged.sum() > RECORDS / 2
    assert_right_no_more_often_than_allowed(cheat, learn, judge)


@pytest.mark.slow
@pytest.mark.parametrize("cheat", IN_GROUPS, ids=lambda cheat: cheat.__name__)
def test_loops_of_one_group_tell_no_more_of_each_other_than_allowed(learn, whole, cheat):
    assert_right_no_more_often_than_allowed(cheat, learn, whole)


@pytest.mark.slow
def test_of_a_part_of_the_grid_no_two_loops_share_a_set_point_a_controller_or_their_noise(judge):
    def different(values: list[float]) -> int:
        return len({float(f"{value:.4g}") for value in values})

    n = len(judge.records)
    # healthy loops for other reasons, and loops of a dead-band, share a plant over disturbances
    assert len({record.sp[0] for record in judge.records}) > 0.95 * n
    gains, times = judge.drifts[:, -4], judge.drifts[:, -3]
    # four digits of some hundred numbers: some agree by chance
    assert different(list(gains * times)) > 0.9 * n
    noise = np.array([np.diff(record.pv, 4)[:200] for record in judge.records])
    alike = np.abs(np.corrcoef(noise)[np.triu_indices(n, 1)])
    assert np.quantile(alike, 0.999) < 0.8


@pytest.mark.slow
def test_of_the_whole_grid_a_pair_shares_its_numbers_but_not_its_noise(whole):
    pairs = defaultdict(list)
    for record in whole.records:
        pairs[record.sp[0]].append(np.diff(record.pv, 4)[:200])
    alike = [abs(np.corrcoef(*noise)[0, 1]) for noise in pairs.values() if len(noise) == 2]
    assert len(alike) > 0.8 * len(pairs)
    assert max(map(len, pairs.values())) == 2
    assert np.median(alike) < 0.3


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """A small exam whose seed is secret."""
    return sit(tmp_path_factory.mktemp("hidden"), "smoke", 6, 75_319)


def test_a_public_seed_tells_everything_and_a_secret_one_nothing(hidden, tmp_path):
    public = sit(tmp_path, "smoke", 6, load_grid("smoke").content.seed)
    book = simulated_book("smoke")
    assert {record.pv.tobytes() for record in public.records} <= set(book)
    assert (look_up(book, public, public) == public.cycled).all()
    assert not {record.pv.tobytes() for record in hidden.records} & set(book)


def test_the_folder_holds_neither_seed_nor_key_and_a_key_within_reach_is_recognised(
    hidden, tmp_path
):
    folder, wanted = hidden.exam.folder, hidden.exam.about["commitment"]
    assert 75_319 not in numbers_in(folder)
    assert key_within(folder, wanted) is None
    shutil.copytree(folder.parent, tmp_path / "all")
    assert key_within(tmp_path / "all", wanted) == tmp_path / "all" / "kept" / "key"
