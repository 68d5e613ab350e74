"""Valve models and valve stages, one file each: the file name is what a loop file calls it."""
