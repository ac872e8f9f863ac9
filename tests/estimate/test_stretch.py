"""The buffers of a live window against plain lists."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from piazzi.estimate.stretch import Stretch

MOVES = st.lists(st.tuples(st.sampled_from(["newest", "late", "row", "row", "leave"]), st.floats(0, 1)), max_size=150)


@given(MOVES)
def test_any_order_of_joining_and_leaving_is_that_of_lists(moves):
    stretch, epochs = Stretch(2, 1), []
    for made, (move, where) in enumerate(moves, 1):
        if move == "newest" or not epochs:
            t = epochs[-1]["t"] + 1 if epochs else 0.0
            assert stretch.open_epoch(stretch.stop, t, made, made / 8) == stretch.stop - 1
            epochs.append({"t": t, "count": made, "scale": made / 8, "x": [made, -made], "rows": []})
            stretch.x[stretch.stop - 1] = epochs[-1]["x"]
        elif move == "late" and len(epochs) > 1:
            at = 1 + int(where * (len(epochs) - 2))
            t = (epochs[at - 1]["t"] + epochs[at]["t"]) / 2
            k = stretch.open_epoch(stretch.find(t), t, made, made / 8)
            assert k == stretch.first + at
            epochs.insert(at, {"t": t, "count": made, "scale": made / 8, "x": [made, -made], "rows": []})
            stretch.x[k] = epochs[at]["x"]
        elif move == "row":
            at = int(where * (len(epochs) - 1))
            stretch.add_row(stretch.find(epochs[at]["t"]), np.array([made / 4]), made)
            epochs[at]["rows"].append((made / 4, made))
        elif move == "leave":
            gone = int(where * len(epochs))
            stretch.first += gone
            del epochs[:gone]
    found = stretch.copied()
    for name in ("t", "count", "scale", "x"):
        assert_array_equal(found[name], np.array([e[name] for e in epochs]).reshape(found[name].shape))
    rows = [row for e in epochs for row in e["rows"]]
    assert_array_equal(found["z"][:, 0], [z for z, _ in rows])
    assert_array_equal(found["station"], [s for _, s in rows])
    assert_array_equal(found["first_row"], np.cumsum([0] + [len(e["rows"]) for e in epochs]))
    assert (len(stretch), stretch.rows) == (len(epochs), len(rows))
    again = Stretch.of(2, 1, found).copied()
    for name, values in found.items():
        assert_array_equal(again[name], values)


def test_a_window_of_constant_length_keeps_its_buffers():
    stretch = Stretch(4, 1)
    rooms = set()
    for k in range(1000):
        stretch.open_epoch(stretch.stop, float(k), 1, 1.0)
        stretch.add_row(stretch.stop - 1, np.zeros(1), 0)
        stretch.first = max(stretch.first, stretch.stop - 10)
        if k > 100:
            rooms.add(stretch.room)
    assert len(rooms) == 1
