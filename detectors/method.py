"""Method: what a detector says about itself, in its own file."""

from __future__ import annotations

from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class Threshold:
    """One number a verdict hangs on, with its meaning.

    Parameters
    ----------
    default : float
        The published value, or an own calibration where none is published.
    unit : str
        "-" for ratios.
    low, high : float
        What a user may set it to.
    source : str
        Where the default comes from.
    says : str
        What lies on its two sides, in one sentence.
    """

    default: float
    unit: str
    low: float
    high: float
    source: str
    says: str


@dataclass(frozen=True)
class Method:
    """A detector's own description; the runner reads it before it runs the detector.

    Parameters
    ----------
    title : str
        What the method looks for, in a few words.
    source : str
        Author, year, equation.
    process : tuple of str
        Process types the method was made for.
    needs_mv : bool
        Whether it judges OP against the valve position (MV, or PV of a flow loop).
    role : {"stiction", "nonlinearity", "quantification"}
        Nonlinearity tests are left out of the stiction ranking.
    budget : {"fast", "full"}
        Whether it belongs to the quick set of methods.
    min_samples : int
        Fewer samples than this: no decision.
    min_periods : float
        Fewer oscillation periods than this: no decision.
    front_end : bool
        False for a method that brings its own oscillation test.
    reversible : bool
        Whether its verdict is the same for the record read backwards.
    cannot_cope : tuple of str
        Data-quality flags under which the method abstains.
    whole : bool
        Judged on the whole record, never on a half that oscillates, and with MV where it was recorded.
    thresholds : dict of str to Threshold
        Keyword arguments of `detect` that a user or a calibration may set.
    exempt : dict of str to str
        Cases of the contract test that do not apply to the method, each with the reason.
    fitted_on : tuple of str
        Grids whose loops, of other seeds, the method's constants were fitted to.
    stated : tuple of str
        Which of S and J come as intervals that are said to hold the truth in nine cases of ten; any other interval is what fits
        the record, without a level.
    published : dict of str to float
        Thresholds at which the method is its source and nothing else; empty when its defaults are that, or when the source
        gives no numbers. `NAME@published` is the method with these.
    chapter : dict of str to float
        The same where Jelali's chapter differs from the method's source; `NAME@chapter`.
    """

    title: str
    source: str
    process: tuple[str, ...] = ("self-regulating", "integrating")
    needs_mv: bool = False
    role: str = "stiction"
    budget: str = "fast"
    min_samples: int = 60
    min_periods: float = 3.0
    front_end: bool = True
    reversible: bool = False
    cannot_cope: tuple[str, ...] = ()
    whole: bool = False
    thresholds: dict[str, Threshold] = field(default_factory=dict)
    exempt: dict[str, str] = field(default_factory=dict)
    fitted_on: tuple[str, ...] = ()
    stated: tuple[str, ...] = ()
    published: dict[str, float] = field(default_factory=dict)
    chapter: dict[str, float] = field(default_factory=dict)

    def defaults(self) -> dict[str, float]:
        """Return the default of every threshold."""
        return {name: t.default for name, t in self.thresholds.items()}

    def as_published(self, chapter: bool = False) -> Method:
        """Return the method with the thresholds of its source, or of the chapter, as defaults."""
        its = self.published | (self.chapter if chapter else {})
        at = {k: replace(t, default=its.get(k, t.default)) for k, t in self.thresholds.items()}
        where = "in the chapter" if chapter else "as published"
        return replace(self, title=f"{self.title}, {where}", thresholds=at, fitted_on=(), published={}, chapter={})
