"""Titles and DOIs of the publications that methods and valve models name by author, year and first
page.
"""

from __future__ import annotations

# first author, year and first page, as a source line has them: title, DOI ("": not known here, or
# not confirmed by a text of others)
PUBLICATIONS = {
    ("Blom", "1988", "780"): (
        "The interacting multiple model algorithm for systems with Markovian switching"
        " coefficients",
        "10.1109/9.1299",
    ),
    ("Wit", "1995", "419"): (
        "A new model for control of systems with friction",
        "10.1109/9.376053",
    ),
    ("Choudhury", "2004", "1719"): (
        "Diagnosis of poor control-loop performance using higher-order statistics",
        "10.1016/j.automatica.2004.03.022",
    ),
    ("Choudhury", "2005", "641"): (
        "Modelling valve stiction",
        "10.1016/j.conengprac.2004.05.005",
    ),
    ("Choudhury", "2006", "1395"): (
        "Automatic detection and quantification of stiction in control valves",
        "",
    ),
    ("He", "2007", "4549"): (
        "A curve fitting method for detecting valve stiction in oscillating control loops",
        "10.1021/ie061219a",
    ),
    ("Horch", "1998", ""): ("A method for detection of stiction in control valves", ""),
    ("Horch", "1999", "1221"): (
        "A simple method for detection of stiction in control valves",
        "",
    ),
    ("Jelali", "2008", "632"): (
        "Estimation of valve stiction in control loops using separable least-squares and global"
        " search algorithms",
        "",
    ),
    ("Kano", "2004", ""): ("Practical model and detection algorithm for valve stiction", ""),
    ("Karnopp", "1985", "100"): (
        "Computer simulation of stick-slip friction in mechanical dynamic systems",
        "10.1115/1.3140698",
    ),
    ("Kayihan", "2000", "799"): ("Friction compensation for a process control valve", ""),
    ("Rossi", "2005", "505"): (
        "A comparison of techniques for automatic detection of stiction: simulation and application"
        " to industrial data",
        "",
    ),
    ("Singhal", "2005", "371"): (
        "A simple method for detecting valve stiction in oscillating control loops",
        "",
    ),
    ("Srinivasan", "2005", "6708"): (
        "Control loop performance assessment. 1. A qualitative approach for stiction diagnosis",
        "",
    ),
    ("Srinivasan", "2005", "6719"): (
        "Control loop performance assessment. 2. Hammerstein model approach for stiction diagnosis",
        "",
    ),
    ("Stenman", "2003", "625"): (
        "A segmentation-based method for detection of stiction in control valves",
        "",
    ),
    ("Thornhill", "2005", "434"): (
        "Finding the source of nonlinearity in a process with plant-wide oscillation",
        "",
    ),
    ("Yamashita", "2006", "503"): (
        "An automatic method for detection of valve stiction in process control loops",
        "",
    ),
}


def details(surname: str, year: str, first_page: str) -> dict[str, str]:
    """Return title and DOI of a publication, as far as they are known.

    >>> details("Karnopp", "1985", "100")["doi"]
    '10.1115/1.3140698'
    >>> details("Nobody", "1999", "1")
    {}
    """
    title, doi = PUBLICATIONS.get((surname, year, first_page), ("", ""))
    return {name: text for name, text in (("title", title), ("doi", doi)) if text}
