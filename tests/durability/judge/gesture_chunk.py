"""Reads chunks of gesture samples. Written from common/gesture/FORMAT.md section 1 alone."""
import struct
from itertools import accumulate

HEADER = 44
MOST_CUT_MEMORY, MOST_PATHS = 1024, 32768
COLUMNS = 31
STANDARD = (1e-6, 2.0**-15, 1e-3, 1e-4, 1e-6, 1e-4)
LENGTH, QUATERNION, FORCE, TORQUE, TIME, SPEED = range(6)
# for columns 2 to 21, which contain real numbers
KINDS = [LENGTH] * 3 + [QUATERNION] * 4 + [SPEED] + [FORCE] * 3 + [TORQUE] * 3 + [LENGTH] * 3 + [LENGTH] * 2 + [QUATERNION]
REALS = range(2, 22)
WALL = range(16, 19)


class Unreadable(Exception):
    """The bytes are not a valid chunk."""


def _crc_table():
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


_TABLE = _crc_table()


def crc32c(data):
    crc = 0xFFFFFFFF
    table = _TABLE
    for byte in data:
        crc = crc >> 8 ^ table[(crc ^ byte) & 255]
    return crc ^ 0xFFFFFFFF


class _Bytes:
    """Reads forward, never beyond the end."""

    def __init__(self, data, start, end):
        self.data, self.at, self.end = data, start, end

    def take(self, count):
        begin, self.at = self.at, self.at + count
        if self.at > self.end:
            raise Unreadable("it ends early")
        return self.data[begin:self.at]

    def varint(self, bits):
        value, shift = 0, 0
        while True:
            byte = self.take(1)[0]
            value |= (byte & 0x7F) << shift
            if value >> bits:
                raise Unreadable(f"a varint of more than {bits} bits")
            if byte < 0x80:
                return value
            shift += 7
            if shift > bits:
                raise Unreadable("a varint of too many bytes")


def _unzigzag(n):
    return -(n + 1 >> 1) if n & 1 else n >> 1


def _block(source, rows, bits, v1, v2):
    """The rows' values of one column, modulo 2**bits; v1 and v2 are the last two before them."""
    head = source.take(1)[0]
    mode, width = head >> 6, head & 63
    if width == 63:
        width = 64
    if width > bits:
        raise Unreadable(f"{width} bits a value in a column of {bits}")
    base = _unzigzag(source.varint(bits)) if mode < 2 else 0
    packed = int.from_bytes(source.take((rows * width + 7) // 8), "little")
    if packed >> rows * width:
        raise Unreadable("unused bits are set")
    ones = (1 << width) - 1
    residuals = [packed >> i * width & ones for i in range(rows)]
    if mode == 0:
        values = [v1 + base + r for r in residuals]
    elif mode == 1:
        values = list(accumulate((base + r for r in residuals), initial=v1))[1:]
    elif mode == 2:
        values = list(accumulate(map(_unzigzag, residuals), initial=v1))[1:]
    else:
        slopes = list(accumulate(map(_unzigzag, residuals), initial=v1 - v2))[1:]
        values = list(accumulate(slopes, initial=v1))[1:]
    mask = (1 << bits) - 1
    return [v & mask for v in values]


def _signed(values, bits):
    top, full = 1 << bits - 1, 1 << bits
    return [v - full if v >= top else v for v in values]


def _doubles(values):
    low = (1 << 63) - 1
    words = [v ^ low if v >> 63 else v for v in values]
    return list(struct.unpack(f"<{len(words)}d", struct.pack(f"<{len(words)}Q", *words)))


class Chunk:
    """count, first_tick, last_tick, steps (six), raw (mask), crc, and columns: the samples' fields by column number. Columns 2 to 21 are numbers in
    SI units; from 22 on integers; 0 is the tick, 1 time_ns. cut_memory: bytes; absent in version 1. paths: bytes; only in version 3."""

    def __init__(self, data):
        if len(data) < HEADER + 4 or data[:4] != b"NLGC":
            raise Unreadable("no chunk begins here")
        if data[4] not in (1, 2, 3):
            raise Unreadable(f"version {data[4]}")
        self.crc = struct.unpack_from("<I", data, len(data) - 4)[0]
        if self.crc != crc32c(data[:-4]):
            raise Unreadable("its CRC does not agree with its bytes")
        code = data[5]
        (less_one, self.first_tick, self.last_tick, first_time, slope, self.raw) = struct.unpack_from("<HQQqqI", data, 6)
        self.count = less_one + 1
        start = HEADER
        if code == 0:
            if len(data) < HEADER + 48 + 4:
                raise Unreadable("it ends within the steps")
            self.steps = struct.unpack_from("<6d", data, HEADER)
            start += 48
        elif code in (1, 2):
            self.steps = STANDARD if code == 1 else (0.0,) * 6
        else:
            raise Unreadable(f"resolution code {code}")
        if not all(step == 0 or 1e-12 <= step <= 1 for step in self.steps):
            raise Unreadable("a step out of its range")
        source = _Bytes(data, start, len(data) - 4)
        self.cut_memory = self._bytes(source, 3 - data[4], MOST_CUT_MEMORY, "memory of the cut") if data[4] >= 2 else b""
        self.paths = self._bytes(source, 1, MOST_PATHS, "paths") if data[4] == 3 else b""
        table = self._table(source)
        if source.at != source.end:
            raise Unreadable("bytes are left over")
        self.columns = self._fields(table, first_time, slope)
        if self.columns[0][-1] != self.last_tick:
            raise Unreadable("its last tick is not the header's")

    @staticmethod
    def _bytes(source, least, most, what):
        length = struct.unpack("<H", source.take(2))[0]
        if not least <= length <= most:
            raise Unreadable(f"{what} of {length} bytes")
        return source.take(length)

    def _bits(self, column):
        return 64 if column < 2 or self.raw >> column & 1 else 32

    def _table(self, source):
        declared = sum(1 << c for c in REALS if self.steps[KINDS[c - 2]] == 0)
        if self.raw & ~sum(1 << c for c in REALS) or declared & ~self.raw:
            raise Unreadable("its mask of raw columns cannot be")
        table = [[0], [0]]
        for c in range(2, COLUMNS):
            value = struct.unpack("<Q", source.take(8))[0] if self.raw >> c & 1 else _unzigzag(source.varint(32))
            table.append([value & (1 << self._bits(c)) - 1])
        left = self.count - 1
        while left > 0:
            rows = min(32, left)
            left -= rows
            mask = struct.unpack("<I", source.take(4))[0]
            if mask >> COLUMNS:
                raise Unreadable("bit 31 of a block's mask is set")
            for c, column in enumerate(table):
                v1 = column[-1]
                if mask >> c & 1:
                    column += _block(source, rows, self._bits(c), v1, column[-2] if len(column) > 1 else v1)
                else:
                    column += [v1] * rows
        return table

    def _fields(self, table, first_time, slope):
        ticks = [row + v for row, v in enumerate(_signed(table[0], 64))]
        fields = [[(self.first_tick + t) % 2**64 for t in ticks],
                  _signed([(first_time + v + t * slope) % 2**64 for t, v in zip(ticks, table[1])], 64)]
        for c in REALS:
            step = self.steps[KINDS[c - 2]]
            fields.append(_doubles(table[c]) if self.raw >> c & 1 else [n * step for n in _signed(table[c], 32)])
        for c in range(22, COLUMNS):
            fields.append(_signed(table[c], 32))
        self.time_step_ns = max(1, int(1e9 * self.steps[TIME] + 0.5))
        for c in (22, 23):
            fields[c] = [min(max(n * self.time_step_ns, -2**31), 2**31 - 1) for n in fields[c]]
        for c, low, high in ((24, 0, 0xFFFF), (25, 0, 0xFFFF), (27, -128, 127), (28, 0, 255), (29, 0, 255), (30, 0, 7)):
            if min(fields[c]) < low or max(fields[c]) > high:
                raise Unreadable(f"column {c} has a value outside {low} to {high}")
        for k, c in enumerate(WALL):
            fields[c] = [v if p >> k & 1 or self.raw >> c & 1 else None for v, p in zip(fields[c], fields[30])]
        fields[26] = [n & 0xFFFFFFFF for n in fields[26]]
        return fields
