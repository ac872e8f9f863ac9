"""Blocks of lines as columns: words of all lines at once, their codes, numbers and dates, without a loop over rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array

CHUNK = 2**20  # bytes of lines that are taken at once: what is made of them stays in the caches, and small
LONGEST = 64
LARGEST = 1e280
_NUMERIC = np.zeros(256, dtype=np.bool_)
_NUMERIC[[0, *b"0123456789+-.eEdD"]] = True


class Chunk(NamedTuple):
    """Some lines: their bytes, the number of the first, and where words of them begin and end."""

    letters: Array
    first_line: int
    starts: Array
    ends: Array
    words_before: Array  # (lines + 1,): words of line i are words_before[i] to words_before[i + 1]
    line_starts: Array

    def words(self, index: Array) -> Array:
        """Words of these indices as a column of bytes."""
        starts, lengths = self.starts[index], self.ends[index] - self.starts[index]
        width = min(int(lengths.max(initial=1)), LONGEST)
        columns = np.arange(width)
        at = np.minimum(starts[:, None] + columns, len(self.letters) - 1)
        table = np.where(columns < lengths[:, None], self.letters[at], np.uint8(0))
        table[lengths > LONGEST, 0] = 0xFF  # too long for a word of any kind: neither keyword nor date nor number
        return np.ascontiguousarray(table).view(f"S{width}").reshape(-1)

    def text(self, i: int) -> str:
        """The line of that index, for messages."""
        end = self.line_starts[i + 1] if i + 1 < len(self.line_starts) else len(self.letters)
        return bytes(self.letters[self.line_starts[i] : end]).decode("utf-8", "replace").strip()


def chunks(data: bytes, start: int, end: int, first_line: int, blanks: bytes = b"") -> Iterator[Chunk]:
    """Lines of ``data[start:end]``, some at a time; letters in `blanks` part words as spaces do."""
    is_blank = np.zeros(256, dtype=np.bool_)
    is_blank[:33] = True
    is_blank[list(blanks)] = True
    while start < end:
        stop = end
        if start + CHUNK < end:
            cut = data.rfind(b"\n", start, start + CHUNK)
            cut = cut if cut >= 0 else data.find(b"\n", start + CHUNK, end)
            stop = cut + 1 if cut >= 0 else end
        letters = np.frombuffer(data, dtype=np.uint8, count=stop - start, offset=start)
        chunk = _chunk(letters, first_line, is_blank)
        yield chunk
        first_line += len(chunk.line_starts)
        start = stop


def _chunk(letters: Array, first_line: int, is_blank: Array) -> Chunk:
    inside = np.zeros(len(letters) + 2, dtype=np.int8)
    inside[1:-1] = ~is_blank[letters]
    edges = np.flatnonzero(inside[1:] != inside[:-1])
    starts, ends = edges[::2], edges[1::2]
    newlines = np.flatnonzero(letters == 10)
    line_starts = np.concatenate([[0], newlines + 1])
    if len(newlines) and newlines[-1] == len(letters) - 1:
        line_starts = line_starts[:-1]
    return Chunk(letters, first_line, starts, ends, np.append(np.searchsorted(starts, line_starts), len(starts)), line_starts)


def coded(words: Array) -> tuple[list[bytes], Array]:
    """The different words of a column in the order in which they come, and which of them each row has."""
    width = -(-words.dtype.itemsize // 8) * 8
    letters = words.astype(f"S{width}").view(np.uint64).reshape(len(words), -1)
    mixed = np.zeros(len(words), dtype=np.uint64)
    for column in range(letters.shape[1]):
        mixed = mixed * np.uint64(0x9E3779B97F4A7C15) + (letters[:, column] ^ (letters[:, column] >> np.uint64(29)))
    _, first, code = np.unique(mixed, return_index=True, return_inverse=True)
    if not np.array_equal(letters[first][code.reshape(-1)], letters):  # two words of one hash, which somebody has looked for
        _, first, code = np.unique(words, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    return [bytes(words[i]) for i in first[order]], place[code.reshape(-1)]


def read_numbers(words: Array) -> tuple[Array, Array]:
    """Numbers of a column of words, NaN where one is none, and a mask of those.

    Digits, a point, an exponent behind e or d: no names of infinity, no underscores, nothing beyond what any unit may multiply.
    """
    letters = np.ascontiguousarray(words).view(np.uint8).reshape(len(words), -1)
    bad = ~_NUMERIC[letters].all(axis=1)
    fortran = (letters | 32) == ord("d")
    if fortran.any():
        letters = np.where(fortran, np.uint8(ord("e")), letters)
        words = np.ascontiguousarray(letters).view(words.dtype).reshape(-1)
    try:
        values = np.where(bad, b"nan", words).astype(np.float64) if bad.any() else words.astype(np.float64)
    except ValueError:
        values = np.array([_number(word) for word in words.tolist()])
    return values, bad | ~(np.abs(values) < LARGEST)


def _number(word: bytes) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan
