#!/usr/bin/env python3
"""Writes refused.tsv: chunks with a valid CRC that a reader must refuse according to common/gesture/FORMAT.md, one per kind of fault.
Written from that page alone. A line has the kind of fault, a tab, and the chunk's bytes in hexadecimal digits."""
import pathlib
import struct

from check_twins import crc32c

SAMPLES = 40  # one block of 32 rows, one of 7
FLAGS_LOW, FLAGS_HIGH, BUTTONS, LAYER, PHASE, FAULT, PRESENCE = 24, 25, 26, 27, 28, 29, 30


def varint(n):
    out = b""
    while n >= 0x80:
        out += bytes([n & 0x7F | 0x80])
        n >>= 7
    return out + bytes([n])


def zigzag(n):
    return 2 * n if n >= 0 else -2 * n - 1


def first_row(values=(), coded=()):
    """All columns in steps; `values`: other integers by column; `coded`: other bytes by column."""
    row = {c: 0 for c in range(2, 31)} | {8: 1 << 15, LAYER: -1} | dict(values)
    return b"".join(dict(coded).get(c, varint(zigzag(row[c]))) for c in range(2, 31))


def block(columns=(), mask=None):
    """A block in which the columns have these bytes; all others repeat their values."""
    columns = dict(columns)
    mask = sum(1 << c for c in columns) if mask is None else mask
    return struct.pack("<I", mask) + b"".join(columns[c] for c in sorted(columns))


def steady(base, bits=0):
    """A column block of mode 1: every value is `base` above the previous one."""
    return bytes([1 << 6 | bits]) + varint(zigzag(base))


def sealed(body):
    return body + struct.pack("<I", crc32c(body))


def chunk(code=1, samples=SAMPLES, last=None, raw=0, steps=b"", cuts=None, paths=None, row=None, blocks=None):
    """`cuts`: the memory of the cut with its length (version 2); `paths`: the paths with theirs (version 3, with `cuts`)."""
    last = 100 + samples - 1 if last is None else last
    head = b"NLGC" + struct.pack("<BBHQQqqI", 1 if cuts is None else 2 if paths is None else 3, code, samples - 1, 100, last, 5_000_000, 1_000_000, raw)
    blocks = [block(), block()] if blocks is None else blocks
    return sealed(head + steps + (cuts or b"") + (paths or b"") + (first_row() if row is None else row) + b"".join(blocks))


def listed(length=1e-6):
    return struct.pack("<6d", length, 2.0**-15, 1e-3, 1e-4, 1e-6, 1e-4)


def refused():
    good = chunk()
    wide = first_row(coded={2: bytes(8)})  # column 2 raw, as indicated by bit 2 of the mask
    yield "an unknown resolution code", chunk(code=3)
    yield "a step below 1e-12", chunk(code=0, steps=listed(1e-13))
    yield "a step above 1", chunk(code=0, steps=listed(1.5))
    yield "a negative step", chunk(code=0, steps=listed(-1e-6))
    yield "a step that is not a number", chunk(code=0, steps=listed(float("nan")))
    yield "an end within the steps", sealed(good[:5] + b"\0" + good[6:44] + bytes(20))
    yield "a raw column below 2", chunk(raw=1 << 1, row=bytes(8) + first_row())
    yield "a raw column above 21", chunk(raw=1 << 22, row=first_row(coded={22: bytes(8)}))
    yield "a step of 0 without raw columns", chunk(code=0, steps=listed(0))
    yield "an end within the header", sealed(good[:30])
    yield "a memory of the cut of no bytes", chunk(cuts=struct.pack("<H", 0))
    yield "a memory of the cut of 4,097 bytes", chunk(cuts=struct.pack("<H", 4097) + bytes(4097))
    yield "an end within the memory of the cut", chunk(cuts=struct.pack("<H", 1024) + bytes(100))
    yield "an end within the length of the memory of the cut", sealed(chunk(cuts=b"")[:45])
    none = struct.pack("<H", 0)
    yield "paths of no bytes", chunk(cuts=none, paths=none)
    yield "paths of 32,769 bytes, as their length says", chunk(cuts=none, paths=struct.pack("<H", 32769) + bytes(100))
    yield "an end within the paths", chunk(cuts=none, paths=struct.pack("<H", 32768) + bytes(100))
    yield "an end within the length of the paths", sealed(chunk(cuts=none, paths=b"")[:47])
    yield "a memory of the cut of 4,097 bytes before paths", chunk(cuts=struct.pack("<H", 4097) + bytes(4097), paths=struct.pack("<HB", 1, 7))
    yield "an end within the first row", sealed(good[:44 + 20])
    yield "a varint of 6 bytes in a column of 32 bits", chunk(row=first_row(coded={2: b"\x80" * 5 + b"\0"}))
    yield "a varint of more than 32 bits", chunk(row=first_row(coded={2: b"\xff" * 4 + b"\x1f"}))
    yield "a varint of more than 64 bits", chunk(raw=4, row=wide, blocks=[block({2: b"\0" + b"\xff" * 9 + b"\x02"}), block()])
    yield "bit 31 of a block's mask", chunk(blocks=[block(mask=1 << 31), block()])
    yield "width 33 in a column of 32 bits", chunk(blocks=[block({2: bytes([2 << 6 | 33]) + bytes(132)}), block()])
    yield "width 63, which means 64, in a column of 32 bits", chunk(blocks=[block({2: bytes([2 << 6 | 63]) + bytes(256)}), block()])
    yield "an end within the residuals", chunk(blocks=[block(), block({2: bytes([2 << 6 | 8]) + bytes(6)})])
    yield "more samples in the header than in the blocks", chunk(samples=SAMPLES + 32)
    yield "fewer samples in the header than in the blocks", chunk(samples=SAMPLES - 8)
    yield "a byte left over", chunk(blocks=[block(), block(), b"\0"])
    yield "low flags of 17 bits in the first row", chunk(row=first_row({FLAGS_LOW: 1 << 16}))
    yield "high flags below 0", chunk(blocks=[block({FLAGS_HIGH: steady(-1)}), block()])
    yield "layer 128", chunk(row=first_row({LAYER: 127}), blocks=[block(), block({LAYER: steady(1)})])
    yield "layer -129", chunk(row=first_row({LAYER: -129}))
    yield "phase 256", chunk(blocks=[block({PHASE: steady(8)}), block()])
    yield "fault 256", chunk(row=first_row({FAULT: 256}))
    yield "presence 8", chunk(row=first_row({PRESENCE: 8}))
    yield "another last tick than the header's", chunk(last=140)


def main():
    folder = pathlib.Path(__file__).parent
    lines = [f"{kind}\t{data.hex()}\n" for kind, data in refused()]
    (folder / "refused.tsv").write_text("".join(lines))
    (folder / "accepted.tsv").write_text("".join(f"{kind}\t{data.hex()}\n" for kind, data in accepted()))


def accepted():
    """Unusual chunks that a reader accepts, with what is unusual about them."""
    yield "varints longer than they need be", chunk(row=first_row(coded={2: b"\x80" * 4 + b"\0", 3: b"\x81\x80\0"}))
    yield "ticks that repeat", chunk(last=100, blocks=[block({0: steady(-1)}), block({0: steady(-1)})])
    yield "ticks that go backwards", chunk(last=100 - 39, blocks=[block({0: steady(-2)}), block({0: steady(-2)})])
    yield "a time that goes backwards", chunk(blocks=[block({1: steady(-2_000_000)}), block()])
    yield "a raw wall that is not a number under its presence bit", chunk(
        raw=1 << 16, row=first_row({PRESENCE: 1}, {16: struct.pack("<Q", 0x7FF8000000000000)}))
    yield "a column block that changes nothing", chunk(blocks=[block({2: bytes([2 << 6])}), block()])
    yield "one sample", chunk(samples=1, blocks=[])
    yield "a memory of the cut of bytes that mean nothing", chunk(cuts=struct.pack("<H", 1024) + bytes(1024))
    yield "a memory of the cut of one byte, behind listed steps", chunk(code=0, steps=listed(), cuts=struct.pack("<HB", 1, 7))
    yield "paths of bytes that mean nothing", chunk(cuts=struct.pack("<H", 0), paths=struct.pack("<H", 500) + bytes(500))
    yield "a memory of the cut and paths, behind listed steps", chunk(
        code=0, steps=listed(), cuts=struct.pack("<HB", 1, 7), paths=struct.pack("<HBB", 2, 8, 9))
    yield "values of phase and fault without a name", chunk(row=first_row({PHASE: 255, FAULT: 255, FLAGS_HIGH: 0xFFFF}))


if __name__ == "__main__":
    main()
