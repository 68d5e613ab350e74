"""The site: tutorials executed, API, formats and detectors written from the code; `make site`,
warnings are errors.
"""

from __future__ import annotations

import os
import re
import sys
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "written"))
# the tutorials call simbench
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])

from api import api_pages
from commands import commands_page
from methods import methods_page

project, author = "simbench", "the simbench authors"
version = release = installed("stiction-simbench")
extensions = ["sphinx.ext.autodoc", "numpydoc", "myst_nb"]
numpydoc_show_class_members = False
autodoc_typehints = "none"
html_theme = "furo"
html_title = "simbench"
html_show_sourcelink = False
html_show_copyright = False
html_copy_source = False
html_css_files = ["wide.css"]
html_static_path = ["_static"]
exclude_patterns = ["generated/.*", "written"]
suppress_warnings = ["myst.header"]  # included pages begin at their titles

# every tutorial runs in a separate folder when the site is built; what fails there is a warning,
# and warnings are errors
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_show_tb = True
nb_execution_timeout = 600
myst_enable_extensions = ["colon_fence"]

generated = HERE / "generated"
startup = generated / "ipython" / "profile_default" / "startup"
startup.mkdir(parents=True, exist_ok=True)
(startup / "bash_cell.py").write_text(
    (HERE / "written" / "bash_cell.py").read_text(encoding="utf-8"), encoding="utf-8"
)
os.environ["IPYTHONDIR"] = str(generated / "ipython")
(generated / "api").mkdir(parents=True, exist_ok=True)
pages = {
    "methods": methods_page(),
    "commands": commands_page(),
    **api_pages(),
}
for page in [*generated.glob("*.rst"), *generated.glob("api/*.rst")]:
    if page.relative_to(generated).with_suffix("").as_posix() not in pages:
        page.unlink()
for name, text in pages.items():
    path = generated / f"{name}.rst"
    # an unchanged page is not read again
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def add_download(app, docname, source):
    """Offer every tutorial as the notebook that ran when the site was built."""
    if docname.startswith("tutorials/"):
        link = f"This page as a notebook: {{nb-download}}`{docname.partition('/')[2]}.ipynb`"
        source[0] = re.sub(r"^# .*$", rf"\g<0>\n\n{link}", source[0], count=1, flags=re.MULTILINE)


def setup(app):
    """Connect what changes pages as they are read."""
    app.connect("source-read", add_download)
