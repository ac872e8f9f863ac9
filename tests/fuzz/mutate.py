"""Good inputs made worse: bytes, tokens and lines; members of archives, data sets of HDF5 files and records of JSON with
their checksums made good again."""

import io
import json
import random
import re
import warnings
import zipfile
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

NUMBERS = (
    *(
        "0",
        "-0.0",
        "1e999",
        "-1e308",
        "nan",
        "inf",
        "1e-320",
        "0x10",
        "1_0",
        "true",
        "1e",
        "--1",
        ".",
        "-1",
        "1" * 27,
        "1e6",
        "4e9",
    ),
    *("8e100", "9" * 400, "9223372036854775808"),
)
HOSTILE = (
    *("<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "</title><svg onload=alert(1)>", "<!--", "\u2028alert(1)"),
    *("\x1b[31mred\x1b[0m", "\x1b]0;t\x07", "\u202eevil", "\x9b31m", "=1+1", "@SUM(A1)", "+cmd|' /C calc'!A0", "$\\frac{a}{$"),
    *("[bold red]x[/]", "{{7*7}}", "%3Cscript%3E", "%s%n", "a\nb", "x\x00y", "../../etc/passwd", "\ud7ff\u0301", "x" * 300),
    *("", " ", "-", "/"),
)
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1, 3, 2**31, 2**63, 8e100, 1e308, float("nan"), float("inf"), "", "ekf", [], {}, [[1, 2], [3]], [1, [2]],
    {"a": {"b": 1}}, *HOSTILE,
)  # fmt: skip
KINDS = ("f8", "f4", "i4", "u1", "?", "c16", "U3", "S2", "m8[s]", "f2", "g", "i8", ">f8")
SHAPES = ((), (0,), (1,), (3,), (4,), (9,), (4, 4), (9, 4), (4, 9), (1, 1), (2, 2, 2), (0, 4), (32,))


def bytewise(data: bytes, rng: random.Random, tokens: Sequence[str], others: Sequence[bytes], longest: int = 2**20) -> bytes:
    """One to a few changes anywhere."""
    for _ in range(1 + int(rng.expovariate(0.7))):
        data = changed(bytearray(data), rng, tokens, others)
    return data[:longest]


def changed(data: bytearray, rng: random.Random, tokens: Sequence[str], others: Sequence[bytes]) -> bytes:
    """One change: a bit, a token, a cut, a repetition, noise, a number, a line, a splice, a word."""
    at = rng.randrange(len(data) + 1)
    end = min(len(data), at + int(rng.expovariate(1 / 20)) + 1)
    token = rng.choice([*NUMBERS, *tokens]).encode("utf-8", "surrogatepass")
    match rng.randrange(10):
        case 0 if at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        case 1:
            data[at:at] = token
        case 2:
            del data[at:end]
        case 3:
            data[at:at] = data[at:end] * rng.choice([1, 2, 50])
        case 4:
            data[at:end] = rng.randbytes(end - at)
        case 5:
            _replace(data, rng, rb"\d+(\.\d+)?(e-?\d+)?", rng.choice(NUMBERS).encode())
        case 6:
            lines = data.split(b"\n")
            a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[a], lines[b] = lines[b], lines[rng.choice([a, b])]
            data = bytearray(b"\n".join(lines))
        case 7:
            other = rng.choice(others)
            data[at:] = other[rng.randrange(len(other) + 1) :]
        case 8:
            del data[at:]
        case _:
            _replace(data, rng, rb"\w+", token)
    return bytes(data)


def _replace(data: bytearray, rng: random.Random, pattern: bytes, new: bytes) -> None:
    found = list(re.finditer(pattern, data))
    if found:
        data[slice(*rng.choice(found).span())] = new


def array(rng: random.Random, like: np.ndarray | None = None) -> np.ndarray:
    """An array that does not belong there: of another kind or shape, or with special values among those of `like`."""
    numbers = np.random.default_rng(rng.randrange(2**32))
    special = [0.0, 1.0, -1.0, 1e-300, 1e300, np.nan, np.inf, 1e6, 15.0, 2.0**53, -0.0]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if like is not None and like.size and like.dtype.kind in "biuf" and rng.random() < 0.6:
            out = np.array(like)
            out.flat[numbers.integers(0, out.size, 1 + int(rng.expovariate(0.5)))] = np.array(special).astype(out.dtype)[
                rng.randrange(len(special))
            ]
            return out
        kind, shape = rng.choice(KINDS), rng.choice(SHAPES)
        return numbers.choice(special, size=shape).astype(kind) if kind[0] not in "USm" else np.zeros(shape, dtype=kind)


def archive(data: bytes, rng: random.Random, others: Sequence[bytes]) -> bytes:
    """The .npz archive with some members changed and all else as it should be, checksums too."""
    out = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            members = {info.filename: old.read(info) for info in old.infolist() if info.file_size < 2**20}
    except Exception:
        return changed(bytearray(data), rng, ["PK\x03\x04", "PK\x05\x06"], others)
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as new:
        warnings.simplefilter("ignore")
        chosen = rng.choice([0.4, 1 / max(1, len(members))])
        for name, content in members.items():
            if rng.random() > 0.02:
                new_name = name if rng.random() > 0.01 else rng.choice(HOSTILE)
                new.writestr(new_name, _member(content, rng) if rng.random() < chosen else content)
    return out.getvalue()


def _member(content: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.4:
        return changed(bytearray(content), rng, ["descr", "shape", "<f8", "|O", "(", "True"], [content])
    try:
        like = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    except ValueError:
        like = None
    out = io.BytesIO()
    np.lib.format.write_array(out, np.asarray(array(rng, like)), allow_pickle=False)
    return out.getvalue()


def twisted(value: Any, rng: random.Random) -> Any:
    """A JSON value with something in it replaced, removed, renamed or doubled."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(list(value))
        rest = {k: v for k, v in value.items() if k != key}
        match rng.randrange(8):
            case 0:
                return rest
            case 1:
                return {**rest, rng.choice([key[:-1], *HOSTILE]): value[key]}
            case _:
                return {**value, key: twisted(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.85:
        at = rng.randrange(len(value))
        match rng.randrange(8):
            case 0:
                return value[:at] + value[at + 1 :]
            case 1:
                return value[:at] + value[at : at + 1] * rng.choice([2, 3, 100]) + value[at + 1 :]
            case _:
                return [*value[:at], twisted(value[at], rng), *value[at + 1 :]]
    return rng.choice(VALUES)


def hdf5(data: bytes, rng: random.Random) -> bytes:
    """The NetCDF file with one or two of its variables changed, or what its JSON says."""
    import h5py

    out = io.BytesIO(data)
    with h5py.File(out, "r+") as root:
        found: list[str] = []
        root.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        for name in rng.sample(found, min(len(found), rng.choice([1, 1, 2]))):
            _variable(root, name, rng)
    return out.getvalue()


def _variable(root: Any, name: str, rng: random.Random) -> None:
    if (root[name].size or 0) > LARGEST:  # declared, never written: larger than any memory
        del root[name]
        return
    old = root[name][()]
    if old.dtype == np.dtype("S1"):
        try:
            new = np.frombuffer(json.dumps(twisted(json.loads(old.tobytes()), rng)).encode(), "S1")
        except ValueError:
            new = array(rng)
    else:
        new = array(rng, old)
    choice = rng.randrange(8)
    if choice and new.shape == old.shape and new.dtype == old.dtype:
        root[name][...] = new
        return
    del root[name]
    match choice:
        case 0:
            return
        case 1:  # declared, never written
            root.create_dataset(name, rng.choice([(10**6,), (3 * 10**8, 4), (1, 2**40), *SHAPES]), "f8", chunks=True)
        case 2:
            root.create_group(name)
        case _ if new.dtype.kind in "US":
            root[name] = new if new.dtype.kind == "S" else "text"
        case _ if new.dtype.kind in "biufc":
            root[name] = new


LARGEST = 2**22  # numbers in a variable
Split = Callable[[bytes], list[tuple[dict[str, Any], bytes]]]


def record_log(data: bytes, rng: random.Random, split: Split, join: Callable[[Any, bytes], bytes]) -> bytes:
    """The log of a study with records lost, doubled, moved or changed, and checksums that are right."""
    records = split(data)
    for _ in range(rng.choice([1, 1, 2])):
        at, other = rng.randrange(len(records)), rng.randrange(len(records))
        header, body = records[at]
        match rng.randrange(8):
            case 0:
                del records[at]
            case 1:
                records.insert(other, records[at])
            case 2:
                records[at], records[other] = records[other], records[at]
            case 3:
                records[at] = header, changed(bytearray(body), rng, ["\0" * 8], [body])
            case 4:
                records[at] = header, records[other][1]
            case _:
                records[at] = twisted(header, rng), body
        if not records:
            break
    return b"".join(join(*record) for record in records)
