"""Functions of signals that several detectors share; they depend on nothing but their arguments."""
