"""A plant's loops on one page."""
