"""What is shown while work is done."""

import io
import logging
import sys
from types import SimpleNamespace

from rich.console import Console

import piazzi as pz
from tests.study.studies import small


def shown(console):
    return console.file.getvalue()


def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=100)


def test_steps_and_compilations_are_shown_and_gone_afterwards():
    console, level = terminal(), logging.getLogger("piazzi").level
    with pz.progress(console) as step:
        step("ekf")
        step._bar.refresh()
        logging.getLogger("piazzi.kernels").info("compiling %d of %d: %s for %s", 3, 6, "filter", "x, v")
        step._bar.refresh()
        step(40, 120)
        step._bar.refresh()
    text = shown(console)
    assert "ekf" in text
    assert "compiling 3 of 6: filter for x, v" in text
    assert "40 of 120" in text
    assert logging.getLogger("piazzi").level == level
    assert not [h for h in logging.getLogger("piazzi").handlers if type(h).__name__ == "_Compiling"]


def test_where_nobody_looks_nothing_is_shown(capsys):
    with pz.progress() as step:
        step("ekf")
        logging.getLogger("piazzi.kernels").info("compiling")
    assert capsys.readouterr() == ("", "")


def test_long_work_takes_it(tmp_path):
    console, study = terminal(), small(runs=8, estimators=("ekf",))
    with pz.progress(console) as step:
        study.run(tmp_path / "s.nc", workers=0, progress=step)
        step._bar.refresh()
    assert "8 of 8" in shown(console)


def test_a_notebook_needs_no_widgets(monkeypatch):
    """Steps are shown by updates of one display, as any notebook has it, and the last leaves it empty."""
    seen = []

    class Handle:
        def update(self, data, raw):
            assert raw
            seen.append(data["text/plain"])

    def display(data, raw, display_id):
        assert raw and display_id
        return Handle()

    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    with pz.progress(Console(force_jupyter=True)) as step:
        step("ekf")
        logging.getLogger("piazzi.kernels").info("compiling 3 of 6")
        for i in range(1, 1001):
            step(i, 1000)
    assert seen[0].startswith("ekf ") and seen[1].startswith("compiling 3 of 6 ")
    assert "1,000 of 1,000 " + 20 * "█" in seen[-2] and seen[-1] == ""
    assert len(seen) < 200
