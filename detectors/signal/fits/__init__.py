"""Fits of a model to a record: a first-order plant behind a static valve map, and the plain linear
one.
"""
