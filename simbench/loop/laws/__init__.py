"""Empirical laws that a record may show and no effect of the library has: each in its block's own
coordinates, as an effect.

A file that `gap discover` writes names one of `LAW_FORMS` and its numbers, and nothing more.
"""

from simbench.loop.laws.forms import LAW_FORMS, Form, apply_law, law_parameters

__all__ = ["LAW_FORMS", "Form", "apply_law", "law_parameters"]
