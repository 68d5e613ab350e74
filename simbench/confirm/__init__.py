"""Confirm that the valve sticks: the confirmation tests of the chapter, on simulated loops and on
records.
"""

from simbench.lazy import called_as

called_as(__name__, "simbench.gap.gain_pair")
