"""Every threshold of the conclusion and of the diagnosis, with its unit and where it comes from
(`simbench list thresholds`).

What a search or a simulation needs to run (grids, steps, numbers of draws) stands where it is used:
no answer is read off it.
"""

from __future__ import annotations


class AnswerThreshold(float):
    """A number on which an answer depends: a plain float with its unit, what it decides, and its
    source, a publication or the command that printed it.
    """

    unit: str
    says: str
    source: str

    def __new__(cls, value: float, unit: str, says: str, source: str) -> AnswerThreshold:
        """Return the number with its account."""
        one = super().__new__(cls, value)
        one.unit = unit
        one.says = says
        one.source = source
        return one

    def __reduce__(self) -> tuple[type, tuple[float]]:
        """Return how a copy is made: a plain number, as what is computed with one."""
        return float, (float(self),)


_WEIGHTS = (
    "learned on loops of three simulators and of a grid whose sound loops are echoes:"
    " python -m results.studies.plant.stiction_probability FOLDER -n 100 --seed 79;"
    " n = 47 prints results/stiction_probability.txt"
)
_CURVE = (
    "a choice on 240 oscillating loops of each of four grids, seed 11, and with an eye on labelled"
    " real loops; on 240 others, seed 12: python -m results.studies.plant.calibration"
    " (results/stiction_probability.txt)"
)
_DENIALS = "python -m results.studies.plant.denials (results/denials.txt)"
_CAUSES = (
    "a choice; how often causes are then right: python -m results.studies.plant.causes"
    " (results/causes.txt)"
)
_SEEDS = "python -m results.studies.plant.gap_seeds (results/gap_seeds.txt)"
_WITHHELD = "python -m results.studies.withheld make, answer, open (results/withheld/)"


_DEVELOPMENT = "development records of simulators that are no longer kept"
_CHOICE = "a choice, not a measurement"

# --- the conclusion ------------------------------------------------------------------------------
CLAIMED_FROM = AnswerThreshold(
    0.8,
    "probability",
    "above it stiction is claimed: a wrong answer costs five times as much as none",
    "Chow 1970, IEEE Trans. Inf. Theory 16; the costs are a choice",
)
DENIED_BELOW = AnswerThreshold(
    0.2,
    "probability",
    "below it stiction is denied: a valve that goes on sticking costs as much as a repair for"
    " nothing",
    "Chow 1970, IEEE Trans. Inf. Theory 16; the costs are a choice",
)
LIKELIER = AnswerThreshold(
    0.5, "probability", "above it an answer is more probable than not", _CHOICE
)
EDGE = AnswerThreshold(
    0.99, "probability", "no probability of stiction is surer than the loops can show", _CHOICE
)
SHORTEST_ASKED = AnswerThreshold(
    60, "samples", "shorter records are not weighed", "detectors.method.Method.min_samples"
)
MEASURED = AnswerThreshold(
    0.2,
    "share of PV's samples",
    "that must have been measured, not repeated or drawn as lines by an archive",
    "python -m results.studies.plant.archives (results/archives.txt)",
)
POOLED = AnswerThreshold(
    0.75,
    "correlation",
    "of the log-odds of one loop's records, given the truth: several records count for little more"
    " than one",
    "records of the same loops in results/stiction_probability.txt",
)

# --- the probability of stiction in an identified loop -------------------------------------------
OFFSET = AnswerThreshold(0.41, "log-odds", "of stiction where nothing is seen", _WEIGHTS)
PER_GAIN = AnswerThreshold(
    1.09, "log-odds", "per unit of asinh(nats that friction brings / 20)", _WEIGHTS
)
PER_BAND = AnswerThreshold(0.61, "log-odds", "per unit of ln(band over OP's range)", _WEIGHTS)
PER_CYCLES = AnswerThreshold(
    -0.79, "log-odds", "per unit of ln(cycles of the record / 10)", _WEIGHTS
)
FULL_NATS = AnswerThreshold(20.0, "nats", "up to which a gain counts in full", _WEIGHTS)
LEAST_REGRESSED = AnswerThreshold(
    -5.0,
    "nats",
    "that a regression takes away at most: noise or a moving set point may hide a valve from it",
    "AUC on loops of refinery .79 without, .85 with it (results/stiction_probability.txt)",
)
SEEN = AnswerThreshold(
    1.9,
    "factor",
    "on how far log-odds are below those of a claim, where friction would have shown plainly",
    _CURVE,
)
HARDLY_SEEN = AnswerThreshold(0.9, "factor", "the same where it would hardly have shown", _CURVE)
SEEN_CYCLES = AnswerThreshold(
    20.0, "cycles", "from which friction would have shown plainly", _CURVE
)
SEEN_PACE = AnswerThreshold(15.0, "samples per period", "that this takes at least", _CURVE)
EXPLAINS = AnswerThreshold(
    50.0, "nats", "of friction, from which a narrow band does not speak against it", _CURVE
)
NARROW = AnswerThreshold(
    0.02, "share of OP's range", "below which a band counts as this wide", _WEIGHTS
)
FEW_CYCLES = AnswerThreshold(6.0, "cycles", "fewer count as so many", _WEIGHTS)
MANY_CYCLES = AnswerThreshold(33.0, "cycles", "more count as so many", _WEIGHTS)

# --- which stiction would have shown -------------------------------------------------------------
WORTH_REPAIRING = AnswerThreshold(
    1.0, "% of travel", "S below which a valve need not be repaired", _CHOICE
)
MAY_STAND = AnswerThreshold(
    5.0,
    "% of travel",
    "of OP's range, within which a valve may stick all the time: few have a wider band",
    _CHOICE,
)
NARROWEST = AnswerThreshold(
    0.2,
    "share of OP's range",
    "below which a band may be there though stiction is denied",
    f"a choice; 7 of 17 sticky valves that are denied have a narrower one: {_DENIALS}",
)


REVERSALS = AnswerThreshold(
    6, "turns of OP", "by more than S, that friction of this size needs", "three cycles of a valve"
)
FEWEST_PER_PERIOD = AnswerThreshold(
    10.0, "samples per period", "with fewer, stiction is not denied: a slip goes unseen", _DENIALS
)
INTEGRAL = AnswerThreshold(
    0.1,
    "share of the record",
    "within which integral action must be felt, where nothing swings",
    _DENIALS,
)

# --- sizes ---------------------------------------------------------------------------------------
AS_GOOD = AnswerThreshold(
    0.25,
    "share of what the likeliest valve explains",
    "that another valve within the interval may lack",
    f"{_CAUSES}: with half a chi-squared of nats S lies within in every third loop",
)
REFITTED = AnswerThreshold(
    60.0,
    "nats",
    "that plant and load, which are held, may bring another valve once they are fitted again",
    _CAUSES,
)

# --- the cause -----------------------------------------------------------------------------------
NAMED_FROM = AnswerThreshold(0.6, "confidence", "below which no cause is named", _CAUSES)
KEPT_OPEN = AnswerThreshold(
    0.9, "share of phase", "kept by one sine, from which a load may swing the loop", _CAUSES
)
KEPT_SURE = AnswerThreshold(0.98, "share of phase", "from which it surely does", _CAUSES)
TIGHT_OPEN = AnswerThreshold(
    2.2, "largest sensitivity", "from which tuning may be the cause", _CAUSES
)
TIGHT_SURE = AnswerThreshold(4.0, "largest sensitivity", "from which it surely can", _CAUSES)
RINGS = AnswerThreshold(
    1.3,
    "gain margin",
    "below which a loop rings after steps of its set point, and its tuning is the cause",
    "each cycle is then more than .44 of the one before, where a quarter is the least damping that"
    " is asked for (Ziegler and Nichols 1942)",
)
RESONANT = AnswerThreshold(
    1.3,
    "times",
    "the period of the largest sensitivity, at most, or its inverse at least, with which a loop"
    " swings for want of damping",
    _CAUSES,
)
NOISY = AnswerThreshold(
    0.75, "share of PV's variance", "that is noise, from which it moves the valve", _CAUSES
)
MOVED = AnswerThreshold(
    1.0, "% of travel", "by which noise moves OP from sample to sample", _CHOICE
)
FEWEST_PERIODS = AnswerThreshold(
    12, "periods", "with fewer, every swing keeps its phase", f"{_CAUSES}, seed 99"
)
STEP_RESTS = AnswerThreshold(
    0.5, "share of samples", "in which OP rests between steps of a threshold", _CHOICE
)
STEP_LEAST = AnswerThreshold(
    0.04, "share of OP's range", "of the least step: archives by exception keep less", _CHOICE
)
OVERSHOOTS = AnswerThreshold(
    0.6, "damping ratio", "up to which a positioner overshoots a step by a tenth", "second order"
)

# --- from evidence to the probabilities of effects -----------------------------------------------
TEMPERATURE = AnswerThreshold(
    0.35,
    "factor on nats",
    "likelihoods overstate, as no model of load and noise is quite true",
    f"calibration on 1456 {_DEVELOPMENT}; expected calibration error: {_WITHHELD}",
)
LEAST_NATS = AnswerThreshold(
    7.0,
    "nats",
    "that anything must bring: the price of thirty questions (3.4) and as much again",
    "with 5, 4 of 80 healthy records more are named, and 1 of 115 effects; " + _DEVELOPMENT,
)
SECOND_NATS = AnswerThreshold(
    12.0, "nats", "that a second effect must bring on top of the first", _DEVELOPMENT
)
OF_TWO = AnswerThreshold(
    0.2,
    "share",
    "of the probability of two effects together, that the weaker one has in the ranking",
    _CHOICE,
)
UNKNOWN_BEFORE = AnswerThreshold(
    0.1, "probability", "that something unknown is lacking, before looking", _CHOICE
)
AFAR = AnswerThreshold(
    4.0,
    "power",
    "of how many times as far as near the simulation stays, by which something unknown is likelier",
    "a choice: of 20 effects named on four simulators within 1.25 times 17 were right, of 13"
    " beyond it 5",
)
TAILS = AnswerThreshold(
    3.0,
    "degrees of freedom",
    "of Student's t, by which a test of a record is compared with those of simulations: so few do"
    " not tell how heavy its tails are",
    _CHOICE,
)
LEAST_SCATTER = AnswerThreshold(
    1.0, "nats", "by which a test scatters between simulations at least", _CHOICE
)
NOMINAL = AnswerThreshold(
    0.1,
    "share",
    "by which a baseline's gain, time constant and dead time may be off without being a gap",
    _CHOICE,
)


MV_TRUE = AnswerThreshold(
    0.9, "probability", "that a recorded MV is the position of the valve, before looking", _CHOICE
)
SEIZED = AnswerThreshold(
    0.9,
    "probability",
    "of stiction where MV stands while OP moves, and PV does not follow OP",
    _CHOICE,
)
MV_PER_NAT = AnswerThreshold(
    0.2,
    "log-odds",
    "against MV, per nat by which PV follows from OP rather than from it",
    _CHOICE,
)
MV_SCALE_NATS = AnswerThreshold(
    10.0, "nats", "that a scale of MV must bring over every valve in the unit of OP", _CHOICE
)
MV_STANDS = AnswerThreshold(
    10.0, "times MV's noise", "that OP must move by while MV stands", _CHOICE
)
MV_STANDS_FOR = AnswerThreshold(
    0.25, "share of the record", "at its end, in which a valve that does not move stands", _CHOICE
)
MV_FOLLOWED = AnswerThreshold(
    0.5,
    "share of PV's standard deviation",
    "by which PV must follow OP while MV stands, for the transmitter of MV to be the one at fault",
    _CHOICE,
)
BY_MV = AnswerThreshold(
    10.0, "nats", "that a valve identified from MV must bring to be put before the plant", _CHOICE
)
SLOW_FAR = AnswerThreshold(
    2.0, "% of travel", "by which a slow valve must be off OP to be a cause", _CHOICE
)
MV_LEFT = AnswerThreshold(
    0.3, "share", "of an ideal valve's misfit to MV, that a map may leave unexplained", _CHOICE
)
MV_LEFT_BY_FRICTION = AnswerThreshold(
    0.85, "share", "the same of a map with friction, known only up to its model", _CHOICE
)


OTHER_LOOP = AnswerThreshold(
    30.0, "nats", "by which another plant must beat every effect on the baseline's", _DEVELOPMENT
)
PLANT_APART = AnswerThreshold(
    1.5, "factor", "in gain or time, by which a plant is another", _CHOICE
)
ORDINARY_CARD = AnswerThreshold(
    0.85,
    "times the stated noise",
    "up to which a lattice of PV is that of any card or archive, and no gap",
    "a choice: cards of 12 to 16 bits and decimals of archives are .2 to .8 of the noise; of 18"
    " records of four simulators that hide a lattice four hide a finer one",
)
FEWEST_SWINGS = AnswerThreshold(
    8.0,
    "periods",
    "an oscillation has at least; a slower one is a load that wanders",
    "three simulators draw no fewer; down to three, 3 of 8 ordinary sines were named",
)
LARGER = AnswerThreshold(
    1.5, "times the stated load", "beyond which it is more than stated", _CHOICE
)


TERM_EXPLAINS = AnswerThreshold(
    0.6,
    "share of what the law leaves",
    "below which a new term of the controller is its law",
    _DEVELOPMENT,
)
MEAN_EXPLAINS = AnswerThreshold(
    0.3, "share of what the law leaves", "the same beside a mean of the archive's", _DEVELOPMENT
)
TERM_NATS = AnswerThreshold(60.0, "nats", "from which a term of the law is shown", _DEVELOPMENT)

# --- the closed loop -----------------------------------------------------------------------------
NEAR = AnswerThreshold(
    1.5,
    "floors",
    "up to which a simulation is near the record: no nearer can be told from as near as possible",
    _SEEDS,
)
COVERED = AnswerThreshold(
    0.94,
    "probability",
    "that the answers which are not excluded have together, lest the truth be excluded in more than"
    " one record in ten",
    "a choice on ten sites; how many of such sets hold the truth on ten others:"
    " python -m results.studies.nuisances (results/nuisances.txt)",
)
GAP_WIDER = AnswerThreshold(
    1.6,
    "times",
    "the interval that seeds give, for the share of the gap that closes: the simulated load is not"
    " quite the plant's",
    "116 records, seed 303",
)
PLAINLY = AnswerThreshold(
    3.0, "standard deviations between simulations", "from which a feature differs", _CHOICE
)


THRESHOLDS = {name: x for name, x in globals().items() if isinstance(x, AnswerThreshold)}


def rows() -> list[dict[str, str]]:
    """Return every threshold as a row of `simbench list`."""
    table = []
    for name, x in THRESHOLDS.items():
        table.append({"name": name, "says": f"{x:g} {x.unit}, {x.says}", "source": x.source})
    return table
