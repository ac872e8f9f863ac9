"""The door of files: packed ones, empty ones, unknown ones."""

import contextlib
import gzip
import random
import shutil
import subprocess

import pytest

import piazzi as pz
from piazzi.formats.lzw import unpacked
from piazzi.formats.recognise import recognise
from piazzi.formats.source import read_bytes
from tests.waiting import little


def compressed(data: bytes, widest: int = 12, clear_when_full: bool = True) -> bytes:
    """A `.Z` file, by the plain algorithm of Welch with the groups of eight codes of compress."""
    header = bytes([0x1F, 0x9D, widest | (128 if clear_when_full else 0)])
    first = 257 if clear_when_full else 256
    codes: dict[bytes, int] = {bytes([i]): i for i in range(256)}
    groups, width, free, word = [[9, []]], 9, first, b""

    def put(code):
        groups[-1][1].append(code)

    def wider(to):
        groups.append([to, []])

    for i in range(len(data)):
        if word + data[i : i + 1] in codes:
            word += data[i : i + 1]
            continue
        put(codes[word])
        if free < 1 << widest:
            codes[word + data[i : i + 1]] = free
            free += 1
            if free > 1 << width and width < widest:
                width += 1
                wider(width)
        elif clear_when_full:
            put(256)
            codes, free, width = {bytes([i]): i for i in range(256)}, first, 9
            wider(9)
        word = data[i : i + 1]
    if word:
        put(codes[word])
    out = bytearray(header)
    for place, (bits, group) in enumerate(groups):
        number = sum(code << (bits * k) for k, code in enumerate(group))
        count = len(group) if place == len(groups) - 1 else -(-len(group) // 8) * 8
        out += number.to_bytes(-(-count * bits // 8), "little")
    return bytes(out)


@pytest.mark.parametrize("widest", [10, 12, 16])
@pytest.mark.parametrize("clear", [True, False])
def test_compress_is_undone(widest, clear, tmp_path):
    rng = random.Random(widest)
    data = b"".join(rng.choice([b"RANGE = ", b"2005-159T", b"\n", bytes([rng.randrange(256)])]) for _ in range(20000))
    packed = compressed(data, widest, clear)
    assert unpacked(packed, 10**7) == data
    if shutil.which("gzip"):  # another reader of the same format
        path = tmp_path / "a.Z"
        path.write_bytes(packed)
        assert subprocess.run(["gzip", "-dc", path], capture_output=True, check=True).stdout == data


def test_damaged_and_boundless_compress_is_refused():
    packed = compressed(b"abcabcabcabc" * 1000)
    with pytest.raises(ValueError, match="more than 100 bytes"):
        unpacked(packed, 100)
    with pytest.raises(ValueError, match="it is no"):
        unpacked(b"ab", 100)
    with pytest.raises(ValueError, match="stands for nothing"):
        unpacked(packed[:3] + b"\xff\xff\xff\xff", 100)
    for seed in range(300):
        rng = random.Random(seed)
        damaged = bytearray(packed)
        for _ in range(3):
            damaged[rng.randrange(2, len(damaged))] = rng.randrange(256)
        with contextlib.suppress(ValueError):
            unpacked(bytes(damaged), 10**6)


def test_gzip_in_several_pieces_is_read_and_damage_is_told(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(gzip.compress(b"one ") + gzip.compress(b"two"))
    assert read_bytes(path) == b"one two"
    path.write_bytes(gzip.compress(b"one " * 100)[:-9])
    with pytest.raises(ValueError, match=r"a\.txt: the file is packed, and damaged"):
        read_bytes(path)


def test_what_is_of_no_format_is_refused_with_the_name(tmp_path):
    path = tmp_path / "a.tdm"
    path.write_text("\n \n")
    with pytest.raises(ValueError, match=r"a\.tdm: the file is empty"):
        pz.read_tracking(path)
    path.write_text("hello\n")
    with pytest.raises(ValueError, match=r"a\.tdm: line 1: the file is of no format that is known"):
        pz.read_tracking(path)
    path.write_text("%=SNX 2.01 JCT 20:119:43200 JCT 79:215:00000 20:119:43200 C 01338 2 X V\n")
    with pytest.raises(ValueError, match=r"give it as --stations .*a\.tdm"):
        pz.read_tracking(path)
    with pytest.raises(OSError):
        pz.read_tracking(tmp_path / "b.tdm")


@pytest.mark.parametrize(
    "piece", [b'<?xml version="1.0"?>', b"<!-- a -->", b" \n", b"# a\n", b"COMMENT a\n", b"00 a\n", b"COD a\n", b"|"]
)
def test_many_of_what_comes_before_a_format_take_no_time(piece):
    """What is gone over again for each of many repetitions would never end: here it takes milliseconds."""
    assert little(lambda: recognise(piece * 1000 + b"x"), 1.0) is None
