"""The small grid and its run, shared by the tests of the benchmark and of the studies; a fault of
the program is a traceback, as in tests.
"""

import os

from bench_fixtures import book, finished, noisy, small, with_answers

from simbench.detectors.faults import RAISED

os.environ[RAISED] = "1"
__all__ = ["book", "finished", "noisy", "small", "with_answers"]
