"""Titles and DOIs of the publications that methods and valve models name by author, year and first
page.
"""

from __future__ import annotations

# first author, year and first page, as a source line has them: title, DOI ("": not known here)
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
        "10.1016/j.conengprac.2005.10.003",
    ),
    ("He", "2007", "4549"): (
        "A curve fitting method for detecting valve stiction in oscillating control loops",
        "10.1021/ie061219a",
    ),
    ("Horch", "1998", ""): ("A method for detection of stiction in control valves", ""),
    ("Horch", "1999", "1221"): (
        "A simple method for detection of stiction in control valves",
        "10.1016/S0967-0661(99)00100-8",
    ),
    ("Jelali", "2008", "632"): (
        "Estimation of valve stiction in control loops using separable least-squares and global"
        " search algorithms",
        "10.1016/j.jprocont.2007.11.004",
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
        "10.1016/j.jprocont.2004.11.003",
    ),
    ("Singhal", "2005", "371"): (
        "A simple method for detecting valve stiction in oscillating control loops",
        "10.1016/j.jprocont.2004.10.001",
    ),
    ("Srinivasan", "2005", "6708"): (
        "Control loop performance assessment. 1. A qualitative approach for stiction diagnosis",
        "10.1021/ie0490280",
    ),
    ("Srinivasan", "2005", "6719"): (
        "Control loop performance assessment. 2. Hammerstein model approach for stiction diagnosis",
        "10.1021/ie049026f",
    ),
    ("Stenman", "2003", "625"): (
        "A segmentation-based method for detection of stiction in control valves",
        "10.1002/acs.769",
    ),
    ("Thornhill", "2005", "434"): (
        "Finding the source of nonlinearity in a process with plant-wide oscillation",
        "10.1109/TCST.2004.839570",
    ),
    ("Yamashita", "2006", "503"): (
        "An automatic method for detection of valve stiction in process control loops",
        "10.1016/j.conengprac.2005.03.004",
    ),
}


def details(surname: str, year: str, first_page: str) -> dict[str, str]:
    """Return title and DOI of a publication, as far as they are known.

    >>> details("Horch", "1999", "1221")["doi"]
    '10.1016/S0967-0661(99)00100-8'
    >>> details("Nobody", "1999", "1")
    {}
    """
    title, doi = PUBLICATIONS.get((surname, year, first_page), ("", ""))
    return {name: text for name, text in (("title", title), ("doi", doi)) if text}
