"""The public names, for people, type checkers and the loader; a further one is one further line."""

from simbench import gap as gap
from simbench.bench.score.shipped import results as results
from simbench.detectors.record import LoopRecord as LoopRecord
from simbench.detectors.records.io import read_record as read_record
from simbench.detectors.verdict import Verdict as Verdict
from simbench.figures import figure as figure
from simbench.gap.diagnosis import conclude as conclude
from simbench.gap.gain_pair import confirm as confirm
from simbench.loop.simulate import simulate as simulate
from simbench.loop.simulate import simulate_batch as simulate_batch
from simbench.theory.predict import predict as predict
from simbench.theory.public_loop import Loop as Loop
from simbench.theory.public_loop import load_loop as load_loop
from simbench.verbs import check as check
from simbench.verbs import contract as contract
from simbench.verbs import detect as detect
from simbench.verbs import diagnose as diagnose
from simbench.verbs import run as run
from simbench.verbs import score as score
from simbench.verbs import table as table

__version__: str
