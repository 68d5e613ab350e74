"""Load the templates of the report."""

from functools import partial

from simbench.html.page import render as render_in

render = partial(render_in, "simbench.report")
