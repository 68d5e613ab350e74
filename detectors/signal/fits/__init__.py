"""Fits of a model to a record: a first-order plant downstream of a static valve map, and the plain
linear one.
"""
