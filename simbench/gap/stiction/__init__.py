"""Compute the probability that a valve sticks from one record; every verb shows this number."""
