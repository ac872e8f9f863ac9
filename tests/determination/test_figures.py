"""Pictures and tables of a determination for papers, against what they are of."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination import figures
from piazzi.determination.figures import drawn, formats_of, view, width_of
from piazzi.determination.page.ecliptic import ellipse
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.latex import as_latex
from piazzi.evaluate.quantities import fine, with_sigma
from piazzi.present.colours import STATIONS
from tests.determination.fixing import observations, truth

T = np.arange(0.0, 43200.0, 900.0)
SIGMA = 5.0


@pytest.fixture(scope="module")
def found():
    noisy = truth(T)[:, :3] + SIGMA * np.random.default_rng(1).standard_normal((len(T), 3))
    noisy[7] += 1e4
    return pz.determine(observations(noisy, T, SIGMA))


def test_they_are_written_at_their_width(found, tmp_path, monkeypatch):
    paths = pz.figures(found, tmp_path / "new", formats="svg,pdf", width="88mm")
    names = {path.stem for path in paths}
    assert names == {"residuals-x", "residuals-y", "residuals-z", "sigma", "orbit", "ground-track"}
    assert {path.suffix for path in paths} == {".svg", ".pdf"} and len(paths) == 2 * len(names)
    for path in paths:
        data = path.read_bytes()
        if path.suffix == ".svg":
            (width,) = re.findall(rb'<svg[^>]* width="([0-9.]+)pt"', data)
        else:
            (width,) = re.findall(rb"/MediaBox ?\[ ?0 0 ([0-9.]+)", data)
        assert float(width) == pytest.approx(88.0 / 25.4 * 72.0, abs=0.1)
    monkeypatch.setattr(figures, "drawn", lambda *of: ((name, one) for name, one in drawn(*of) if name == "orbit"))
    again = found.figures(tmp_path / "again", "svg,pdf")
    assert {a.name: a.read_bytes() for a in again} == {p.name: p.read_bytes() for p in paths if p.stem == "orbit"}  # no date


def test_axes_have_units_and_no_titles(found):
    for name, figure in drawn(found, 3.5):
        for ax in (ax for ax in figure.axes if ax.axison):
            assert ax.get_title() == "", name
            assert ax.get_ylabel().endswith("]"), name
            assert ax.get_xlabel().endswith("]"), name


def test_residuals_are_those_of_the_determination(found):
    figure = dict(drawn(found, 3.5))["residuals-x"]
    used, left = figure.axes[0].lines[:2]
    own = found.residuals.where(found.residuals.kind == "x", drop=True)
    keep = own.used.values.astype(bool)
    assert np.allclose(used.get_ydata(), own.o_minus_c.values[keep])
    assert np.allclose(used.get_xdata() * 3600.0, own.time.values[keep])
    assert len(left.get_xdata()) == 1 and left.get_marker() == "x"
    low, high = figure.axes[0].get_ylim()
    assert low < left.get_ydata()[0] < high  # a kilometre off, and seen


def test_colours_differ_for_every_eye():
    """Those with any two of the three kinds of cones tell them apart by what these two see."""
    rgb = np.array([[int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)] for c in STATIONS]) ** 2.2
    lms = rgb @ np.array([[0.314, 0.155, 0.018], [0.640, 0.759, 0.109], [0.047, 0.087, 0.873]])
    for missing in range(3):
        seen = np.delete(lms, missing, axis=1)
        apart = np.linalg.norm(np.cbrt(seen)[:, None] - np.cbrt(seen)[None], axis=2)
        assert apart[np.triu_indices(len(seen), 1)].min() > 0.03


@pytest.mark.parametrize(("call", "says"), [
    (lambda: formats_of("pdf,gif"), "--format 'gif'"), (lambda: width_of("wide"), "--width 'wide'"),
    (lambda: width_of("9m"), "88mm"),
    (lambda: width_of("1mm"), "between 20 mm"),
])  # fmt: skip
def test_what_cannot_be_is_refused(call, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        call()


def test_widths_have_units():
    assert width_of("88") == width_of("88mm") == width_of("8.8cm") == 88.0
    assert width_of("3.5in") == pytest.approx(88.9)


def test_latex_has_every_cell_and_nothing_that_latex_reads(found):
    text = found.to_latex()
    # state, elements, what is estimated beside them, residuals, what was not used
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == 5
    state, _, beside = (
        [line.split(" & ") for line in table.splitlines() if line.endswith(r"\\")][1:]
        for table in text.split(r"\end{tabular}")[:3]
    )
    assert [row[0] for row in state] == ["x", "y", "z", "vx", "vy", "vz"]
    assert len(beside) == len(found.problem.model.names) - 6
    for row in (*state, *beside):
        value, sigma = (cell.strip("$") for cell in row[1:3])
        assert len(value.partition(".")[2]) == len(sigma.partition(".")[2])  # rounded by the sigma
        assert len(sigma.replace(".", "").lstrip("0")) == 2
    grid = Grid("a_b", ("", "m^2\n[%]"), (("50% & {x}_$", "-1.5e-07"),))
    body = as_latex([grid]).splitlines()[3:]
    assert body[0] == r" & m$^{2}$ [\%] \\" and body[2] == r"50\% \& \{x\}\_\$ & $-1.5 \times 10^{-7}$ \\"


def test_an_orbit_in_space_is_seen_from_three_sides_and_from_aslant(found):
    figure = dict(drawn(found, 3.5))["orbit"]
    *sides, space = figure.axes
    assert [(ax.get_xlabel()[0], ax.get_ylabel()[0]) for ax in sides] == [("x", "y"), ("z", "y"), ("x", "z")]
    assert {ax.get_xlim() + ax.get_ylim() for ax in sides} == {sides[0].get_xlim() * 2}
    place = found.estimate.mean[:, :3] / 1e6
    for ax, (i, j) in zip(sides, ((0, 1), (2, 1), (0, 2)), strict=True):
        pieces = [np.stack(line.get_data(), axis=1) for line in ax.lines]
        points = np.concatenate([piece[np.isfinite(piece).all(axis=1)] for piece in pieces])
        nearest = np.linalg.norm(points[None] - place[::8, [i, j]][:, None], axis=2).min(axis=1)
        assert nearest.max() < 1.0  # of 26, a sixteenth of a revolution at the most
    assert not space.axison and [text.get_text() for text in space.texts] == ["x", "y", "z"]


def test_what_is_behind_the_earth_is_dotted():
    """Seen from -y, with x to the right and z up, the half with y > 0 is behind."""
    from matplotlib.figure import Figure

    turn = np.linspace(0.0, 2 * np.pi, 400)
    place = 7e6 * np.stack([np.cos(turn), 0.8 * np.sin(turn), 0.6 * np.sin(turn)], axis=1)
    path = SimpleNamespace(about="earth", mean=np.hstack([place, place]))
    ax = view(Figure().add_subplot(), path, 3.986e14, 0, 2)
    seen, hidden = (np.isfinite(line.get_xdata()) for line in ax.lines)
    assert [line.get_linestyle() for line in ax.lines] == ["-", ":"]
    assert np.array_equal(hidden, (np.hypot(place[:, 0], place[:, 2]) < 6378137.0) & (place[:, 1] > 0))
    assert np.array_equal(seen, ~hidden)


def test_the_whole_ellipse_is_that_of_the_state():
    mu, state = 1.32712440018e20, np.array([2.0e11, 2.5e11, -3.0e10, -1.5e4, 1.0e4, 4.0e3])
    points, h = ellipse(state, mu), np.cross(state[:3], state[3:])
    assert np.abs(points @ h).max() < 1e-9 * np.linalg.norm(h) * np.linalg.norm(points, axis=1).max()
    towards = np.cross(state[3:], h) / mu - state[:3] / np.linalg.norm(state[:3])  # the equation of the conic: r + e.r = p
    np.testing.assert_allclose(np.linalg.norm(points, axis=1) + points @ towards, h @ h / mu, rtol=1e-10)
    assert ellipse(state * [1, 1, 1, 5, 5, 5], mu).shape == (0, 3)


def test_small_angles_are_told_in_seconds_of_arc_and_zero_has_no_sign():
    assert (fine("rad", 1e-5).unit, fine("rad", 0.1).unit, fine("m", 1e-5).unit) == ("arcsec", "deg", "m")
    assert 1e-5 * fine("rad", 1e-5).factor == pytest.approx(2.0626480624709636)
    assert with_sigma(-1e-7, 0.0011) == ("0.0000", "0.0011")
