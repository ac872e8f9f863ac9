"""Files of the Unix program compress (``.Z``): LZW with codes of 9 to at most 16 bits (Welch 1984)."""

from __future__ import annotations

_CLEAR = 256


def unpacked(data: bytes, limit: int) -> bytes:
    """What a ``.Z`` file holds.

    Codes come in groups of eight; the rest of a group is skipped where their width changes.
    Raises ValueError for codes that cannot be, or for more than `limit` bytes.
    """
    if len(data) < 3 or data[:2] != b"\x1f\x9d":
        raise ValueError("it is no .Z file")
    widest, blocks = data[2] & 31, bool(data[2] & 128)
    if not 10 <= widest <= 16:  # with 9, compress itself goes on to 10
        raise ValueError(f"its codes have {widest} bits")
    first = _CLEAR + 1 if blocks else _CLEAR
    strings: list[bytes] = [bytes([i]) for i in range(256)] + [b""] * (first - 256)
    out = bytearray()
    width, start, bit, previous = 9, 24, 24, b""
    end = 8 * len(data)
    while bit + width <= end:
        byte, shift = divmod(bit, 8)
        code = int.from_bytes(data[byte : byte + 3], "little") >> shift & ((1 << width) - 1)
        bit += width
        if blocks and code == _CLEAR:
            del strings[first:]
            bit = start + -(-(bit - start) // (8 * width)) * 8 * width
            width, start, previous = 9, bit, b""
            continue
        if code > len(strings) or (code == len(strings) and not previous):
            raise ValueError(f"code {code} after {len(out):,} bytes stands for nothing")
        entry = strings[code] if code < len(strings) else previous + previous[:1]
        out += entry
        if len(out) > limit:
            raise ValueError(f"it unpacks to more than {limit:,} bytes")
        if previous and len(strings) < 1 << widest:
            strings.append(previous + entry[:1])
        previous = entry
        if len(strings) >= 1 << width and width < widest:
            bit = start + -(-(bit - start) // (8 * width)) * 8 * width
            width, start = width + 1, bit
    return bytes(out)
