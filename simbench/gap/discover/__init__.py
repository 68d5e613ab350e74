"""What has no name described by an empirical law: where, in which form, with what certificate, and
how far the gap shrinks.
"""
