"""Figures as files: what is written, what is left out and why, and that no text is cut off or
covers another.
"""

import inspect
from pathlib import Path

import matplotlib
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

import simbench as sb
from simbench.cli import main
from simbench.cli.catalogue import catalogue
from simbench.detectors.errors import UserError
from simbench.figures import make_figures
from simbench.figures._folder import FIGURES
from simbench.figures._loops import pi_loop
from simbench.figures._make import figure_ids
from simbench.figures._records import NeedsRecord
from simbench.theory.sampled import sampled_loop, ultimate_gain
from tests.simbench.boundary.conftest import sampled

REAL = Path(__file__).parents[4] / "shared" / "data" / "real"
ISDB = REAL.parent / "isdb"
NAMES = FIGURES.names()
needs_real = pytest.mark.skipif(
    not REAL.is_dir(), reason="the folder of real records ../shared/data/real is absent"
)


def needs(name: str) -> list[str]:
    return [p for p in parameters(name) if p != "loops"]


def parameters(name: str) -> list[str]:
    return list(inspect.signature(FIGURES.load(name).data).parameters)


DEAR = ("fig_11_9_integrating",)
FREE = [
    pytest.param(name, marks=pytest.mark.slow if name in DEAR else ())
    for name in NAMES
    if not needs(name)
]
OF_REAL_LOOPS = [name for name in NAMES if needs(name) == ["isdb"]]


def test_every_figure_and_table_of_the_chapter_has_an_id_in_its_order():
    ids = figure_ids()
    wanted = range(1, 28)
    assert [i for i in ids if i in {f"fig-11-{n}" for n in wanted}] == [
        f"fig-11-{n}" for n in wanted
    ]
    assert {f"table-11-{n}" for n in (1, 2, 3, 4)} <= set(ids)


def test_the_catalogue_lists_figures_by_their_public_id():
    assert {row["name"] for row in catalogue("figures")} == set(figure_ids())


@pytest.mark.parametrize("name", FREE)
def test_axes_have_quantity_and_unit_and_no_text_is_cut_off_or_covers_another(drawn, name):
    figure = FIGURES.load(name).draw(drawn(name))
    for axes in figure.axes:
        if axes.axison and axes.get_xticks().size and axes.get_label() != "<colorbar>":
            for label in (axes.get_xlabel(), axes.get_ylabel()):
                assert not label or "(" in label or "/" in label, f"{label!r} has no unit"
    _check_texts(figure)


@needs_real
@pytest.mark.parametrize("name", OF_REAL_LOOPS)
def test_no_text_is_cut_off_or_covers_another_with_real_loops(drawn, name):
    made = make_figures([], "/tmp", isdb=REAL)  # the folder itself is accepted
    assert made == []
    try:
        data = drawn(name, REAL)
    except NeedsRecord as error:
        pytest.skip(str(error))
    _check_texts(FIGURES.load(name).draw(data))


def _check_texts(figure) -> None:
    figure.set_dpi(200)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    page = figure.bbox.padded(1.0)
    axes = [axis for a in figure.axes for axis in (a.xaxis, a.yaxis)]
    not_drawn = {t for axis in axes for t in axis.get_ticklabels(which="both")}
    for axis in axes:
        if axis.axes.axison:
            low, high = sorted(axis.get_view_interval())
            ticks = zip(axis.get_majorticklocs(), axis.get_majorticklabels())
            not_drawn -= {t for at, t in ticks if low - 1e-9 <= at <= high + 1e-9}
    boxes = []
    for text in figure.findobj(Text):
        if not (text.get_visible() and text.get_text().strip()) or text in not_drawn:
            continue
        box = text.get_window_extent(renderer)
        assert page.x0 <= box.x0 <= box.x1 <= page.x1, f"cut off at a side: {text.get_text()!r}"
        assert page.y0 <= box.y0 <= box.y1 <= page.y1, (
            f"cut off above or below: {text.get_text()!r}"
        )
        boxes.append((box.padded(-1.5), text.get_text()))
    for i, (a, one) in enumerate(boxes):
        for b, other in boxes[i + 1 :]:
            assert not a.overlaps(b), f"{one!r} covers {other!r}"


def test_each_figure_is_written_as_svg_png_and_csv(tmp_path):
    made = make_figures(["fig-11-5", "table_11_4"], tmp_path)
    assert [m.id for m in made] == ["fig-11-5", "table-11-4"]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        f"{i}.{kind}" for i in ("fig-11-5", "table-11-4") for kind in ("csv", "png", "svg")
    )
    assert (tmp_path / "fig-11-5.png").read_bytes().startswith(b"\x89PNG")
    assert b"</svg>" in (tmp_path / "fig-11-5.svg").read_bytes()
    frame = pd.read_csv(tmp_path / "fig-11-5.csv")
    pd.testing.assert_frame_equal(
        frame, FIGURES.load("fig_11_5").data(), check_dtype=False, rtol=1e-5
    )


def test_the_same_figure_gives_the_same_bytes(tmp_path):
    first, second = (make_figures(["fig-11-14"], tmp_path / folder)[0].files for folder in "ab")
    for a, b in zip(first, second):
        assert a.read_bytes() == b.read_bytes()


@needs_real
def test_real_loops_give_the_printed_yamashita_indices(drawn, tmp_path):
    d = drawn("fig_11_12", REAL)
    assert d["rho1 (-)"].iloc[0] == pytest.approx(0.48, abs=0.01)
    assert d["rho3 (-)"].iloc[0] == pytest.approx(0.41, abs=0.01)
    assert [f.suffix for f in make_figures(["fig-11-12"], tmp_path, isdb=REAL)[0].files] == [
        ".svg",
        ".png",
        ".csv",
    ]


def test_drawing_leaves_the_users_settings_alone(drawn):
    before = dict(matplotlib.rcParams)
    FIGURES.load("table_11_4").draw(drawn("table_11_4"))
    assert dict(matplotlib.rcParams) == before


def test_a_figure_carries_the_numbers_of_its_loops(tmp_path, capsys):
    out = ["-o", str(tmp_path)]
    assert main(["figure", "fig-11-8", *out, "--set", "S=6", "--set", "Td_over_T=0.3"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Drawn with S = 6, Td_over_T = 0.3 in place of the figure's own" in said
    assert "Where the curves meet" not in said
    assert "Source: after Jelali (2013), Fig. 11.8" in said
    table = pd.read_csv(tmp_path / "fig-11-8-S-6-Td_over_T-0.3.csv")
    assert not (tmp_path / "fig-11-8.csv").exists()
    assert main(["figure", "fig-11-8", *out]) == 0
    assert "Where the curves meet" in " ".join(capsys.readouterr().out.split())
    own = table[table.panel == "(a) self-regulating"]
    assert own["S (%)"].dropna().eq(6.0).all()
    assert own["Td (s)"].tolist() == pytest.approx([0.3 * 10.0] * len(own))
    assert table[table.panel == "(b) integrating"]["Td (s)"].eq(1.0).all()  # it has no T
    assert "S = 6 %" in sb.figure("11.8", S=6.0).get_suptitle()


def test_a_loop_that_other_numbers_make_unstable_is_retuned_and_that_is_said(tmp_path):
    (drawn,) = make_figures(["fig-11-9"], tmp_path, numbers={"Td_over_T": 1.0})
    assert "loops would be unstable without friction: Kc was lowered there" in drawn.caption
    assert "OP stays a triangle" not in drawn.caption
    table = pd.read_csv(drawn.files[2])
    for _, row in table.drop_duplicates(["panel", "Kc"]).iterrows():
        loop = pi_loop(
            K=row["K"], T=row["T (s)"], Td=row["Td (s)"], Kc=row["Kc"], Ti=row["Ti (s)"], Ts=2.0
        )
        assert ultimate_gain(sampled_loop(loop)) > 1.5
    assert table["OP (%)"].between(0.1, 99.9).all()
    with pytest.raises(UserError, match=r"unstable without friction; less than 7.63 is needed"):
        sb.figure("fig-11-8", Kc=40.0)


@pytest.mark.skipif(not ISDB.is_dir(), reason="the records of ISDB are not here")
def test_a_folder_that_lacks_a_record_is_answered_in_a_sentence(tmp_path, capsys):
    assert main(["figure", "fig-11-6", "--isdb", str(ISDB), "-o", str(tmp_path)]) == 0
    assert main(["figure", "fig-11-12", "--isdb", str(tmp_path), "-o", str(tmp_path)]) == 2
    assert "needs ISDB loop" in capsys.readouterr().err


@pytest.mark.parametrize("name", sampled([n for n in NAMES if "loops" in parameters(n)], 5))
def test_every_simulated_figure_says_its_numbers_and_is_redrawn(name):
    picture = sb.figure(name)
    _check_texts(picture)
    first = picture.get_suptitle()
    number, value = ("S", 4.5) if "S = " in first else ("K", 0.9)
    assert f"{number} = {value}" in sb.figure(name, **{number: value}).get_suptitle()
    assert f"{number} = {value}" not in first
