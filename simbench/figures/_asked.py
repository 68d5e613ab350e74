"""Write what is asked of the scores of a run to one file: a table or a picture."""

from pathlib import Path

from simbench.bench.score import paper
from simbench.bench.score.asked import Asked
from simbench.bench.score.picture import sides
from simbench.bench.store.benchmark import benchmark_text, benchmark_version
from simbench.detectors.errors import ParameterError
from simbench.page.style import write_picture


def write_asked(asked: Asked, path: Path) -> None:
    """Write one table or picture; the kind follows from the file's name."""
    # A picture is of the ranking alone
    if asked.paired and asked.axes:
        raise ParameterError(f"--to {path}: one table is written; give one of --paired and --by")
    if path.suffix.lower() in (".svg", ".pdf", ".png"):
        if asked.paired or asked.axes:
            raise ParameterError(
                f"--to {path}: a picture is of the ranking; .tex, .md or .csv is needed with"
                " --paired and --by"
            )
        write_picture(sides(asked.scores.rows(asked.truth)).figure, path)
        return

    # One table: of pairs, over an axis, or of the ranking
    paper.table_kind(path)
    about = paper.caption(asked.scores, asked.truth)
    version = benchmark_version(asked.scores.manifest)
    if asked.comparison is not None:
        comparison = asked.comparison
        about = (
            f"{comparison.cases} scenarios{benchmark_text(asked.scores.manifest)}, right against"
            f" {comparison.truth} (exact McNemar test,"
            f" Holm-corrected p); {comparison.legend}"
        )
        numbers = comparison.pairs
        text = paper.pairs_text(comparison)
    elif asked.rates is not None:
        about = paper.caption_along(asked.scores, asked.rates, asked.truth)
        numbers = asked.rates
        text = paper.along_text(asked.rates)
    else:
        numbers = paper.ranking_numbers(asked.scores, asked.truth)
        text = paper.ranking_text(asked.scores, asked.truth)

    # The table states its benchmark version
    paper.write(path, numbers.assign(benchmark=version), text, about)
