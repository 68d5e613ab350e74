"""Fit models to a record: a first-order plant downstream of a static valve map, and a linear
plant.
"""
