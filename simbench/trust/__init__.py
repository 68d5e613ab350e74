"""Apply the benchmark to one loop of a plant: which detector to trust on it, and which stiction its
record could have shown.
"""

from simbench.lazy import called_as

called_as(__name__, "simbench.trust.trust")
