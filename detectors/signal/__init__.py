"""Pure functions on signals that several detectors share."""
