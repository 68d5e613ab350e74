"""Test whether the stated controller computes the recorded OP from the recorded error, and find
what differs if not.
"""
