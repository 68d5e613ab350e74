"""The public names of the gap diagnosis."""

from simbench.gap.benchmark.measure import grid as grid
from simbench.gap.benchmark.result import GridGap as GridGap
from simbench.gap.diagnosis import conclude as conclude
from simbench.gap.diagnosis import diagnose as diagnose
from simbench.gap.report.result import GapReport as GapReport
