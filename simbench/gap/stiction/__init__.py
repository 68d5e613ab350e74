"""How probable it is that a valve sticks: friction weighed on one record, the one number that every
verb shows.
"""
