"""Check whether record and baseline can be compared, and identify a baseline if none is given."""
