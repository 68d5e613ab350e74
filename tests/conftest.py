"""A fault of the program is a traceback wherever tests run, in the processes they start as well."""

import os

from simbench.detectors.faults import RAISED

os.environ[RAISED] = "1"
