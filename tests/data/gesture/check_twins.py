#!/usr/bin/env python3
"""A second reader of common/gesture/FORMAT.md, written from that page: compares every golden file with its JSON twin."""
import hashlib
import json
import math
import pathlib
import struct
import sys

STANDARD = (1e-6, 2.0**-15, 1e-3, 1e-4, 1e-6, 1e-4)
NAMES = ("px_m py_m pz_m qx qy qz qw speed_m_s fx_n fy_n fz_n tx_nm ty_nm tz_nm wx_m wy_m wz_m "
         "insertion_m lateral_error_m plunger").split()
KINDS = [0, 0, 0, 1, 1, 1, 1, 5, 2, 2, 2, 3, 3, 3, 0, 0, 0, 0, 0, 1]  # into the six steps


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


class Columns:
    def __init__(self, data, at, end):
        self.data, self.at, self.end = data, at, end

    def take(self, count):
        assert self.at + count <= self.end, "ends early"
        self.at += count
        return self.data[self.at - count:self.at]

    def varint(self):
        value = shift = 0
        while True:
            byte = self.take(1)[0]
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value


def unzigzag(n):
    return n >> 1 if n % 2 == 0 else -(n + 1) // 2


def signed(n, bits):
    n &= (1 << bits) - 1
    return n - (1 << bits) if n >> (bits - 1) else n


def column_block(data, rows, last, before):
    head = data.take(1)[0]
    mode, width = head >> 6, head & 63
    width = 64 if width == 63 else width
    base = unzigzag(data.varint()) if mode < 2 else 0
    packed = int.from_bytes(data.take((rows * width + 7) // 8), "little")
    values, slope = [], last - before
    for i in range(rows):
        r = packed >> (i * width) & ((1 << width) - 1)
        previous = values[-1] if values else last
        if mode == 0:
            values.append(last + base + r)
        elif mode == 1:
            values.append(previous + base + r)
        elif mode == 2:
            values.append(previous + unzigzag(r))
        else:
            slope += unzigzag(r)
            values.append(previous + slope)
    return values


def cut_memory(data):
    version, count, place, zero, tick, insertions = struct.unpack_from("<BBBBQQ", data)
    assert version in (2, 3) and zero == 0
    tracks, at = [], 20
    for i in range(count):
        *entry, ux, uy, uz, length, membranes = struct.unpack_from("<7dI", data, at)
        at += 60
        tracks.append({"entry_m": entry, "direction": [ux, uy, uz], "length_m": length, "membranes": membranes})
        if version == 3:
            holes = data[at]
            tracks[-1]["holes"] = [list(struct.unpack_from("<Bd", data, at + 1 + 9 * k)) for k in range(holes)]
            at += 1 + 9 * holes
    assert at == len(data)
    return {"tick": tick, "insertions": insertions, "next": place, "tracks": tracks}


def paths_in(data):
    paths, at = [], 0
    while at < len(data):
        end = at + 2 + struct.unpack_from("<H", data, at)[0]
        version, layers, tick, *numbers = struct.unpack_from("<BBQ11d", data, at + 2)
        assert version == 2
        at += 2 + 98
        path = {"tick": tick, "point_m": numbers[:3], "normal": numbers[3:6], "ball_m": numbers[6:9],
                "ball_radius_m": numbers[9], "asked_depth_m": numbers[10], "layers": []}
        for _ in range(layers):
            path["layers"].append(list(struct.unpack_from("<Bd", data, at)))
            at += 9
        assert at == end
        paths.append(path)
    return paths


def read_chunk(data):
    assert data[:4] == b"NLGC" and data[4] in (1, 2, 3)
    assert struct.unpack("<I", data[-4:])[0] == crc32c(data[:-4]), "CRC"
    code = data[5]
    count = struct.unpack_from("<H", data, 6)[0] + 1
    first_tick, last_tick, first_time, slope, raw = struct.unpack_from("<QQqqI", data, 8)
    steps = struct.unpack_from("<6d", data, 44) if code == 0 else STANDARD if code == 1 else (0.0,) * 6
    columns = Columns(data, 92 if code == 0 else 44, len(data) - 4)
    cuts = columns.take(struct.unpack("<H", columns.take(2))[0]) if data[4] >= 2 else b""
    paths = columns.take(struct.unpack("<H", columns.take(2))[0]) if data[4] == 3 else b""
    wide = raw | 3

    table = [[0], [0]]
    for c in range(2, 31):
        table.append([struct.unpack("<Q", columns.take(8))[0] if raw >> c & 1 else unzigzag(columns.varint())])
    while len(table[0]) < count:
        rows = min(32, count - len(table[0]))
        mask = struct.unpack("<I", columns.take(4))[0]
        for c in range(31):
            last = table[c][-1]
            before = table[c][-2] if len(table[c]) > 1 else last
            table[c] += column_block(columns, rows, last, before) if mask >> c & 1 else [last] * rows
    assert columns.at == columns.end, "bytes left over"

    time_step = max(1, math.floor(steps[4] * 1e9 + 0.5)) if steps[4] * 1e9 >= 1.5 else 1
    declared = sum(1 << (2 + i) for i in range(20) if steps[KINDS[i]] == 0)
    samples = []
    for row in range(count):
        value = [signed(table[c][row], 64 if wide >> c & 1 else 32) for c in range(31)]
        ticks = value[0] + row
        s = {"tick": (first_tick + ticks) % 2**64, "time_ns": signed(first_time + value[1] + ticks * slope, 64)}
        s["t_s"] = signed(s["time_ns"] - first_time, 64) / 1e9
        for i, name in enumerate(NAMES):
            n = value[2 + i]
            if raw >> (2 + i) & 1:
                bits = n % 2**64
                x = struct.unpack("<d", struct.pack("<Q", bits ^ (2**63 - 1) if bits >> 63 else bits))[0]
            else:
                x = n * steps[KINDS[i]]
            if 14 <= i <= 16 and not value[30] >> (i - 14) & 1:
                x = math.nan
            s[name] = x if math.isfinite(x) else None
        for name, n in (("device_ns", value[22]), ("engine_ns", value[23])):
            s[name] = min(max(n * time_step, -2**31), 2**31 - 1)
        s["flags"] = value[24] | value[25] << 16
        s["buttons"] = value[26] % 2**32
        s["layer"], s["phase"], s["fault"] = value[27:30]
        samples.append(s)
    assert samples[-1]["tick"] == last_tick
    keys = ("length_m", "quaternion", "force_n", "torque_nm", "time_s", "speed_m_s")
    more = ({"cut_memory": cut_memory(cuts)} if cuts else {}) | ({"paths": paths_in(paths)} if paths else {})
    return {"version": data[4], "count": count, "first_tick": first_tick, "last_tick": last_tick, "first_time_ns": first_time,
            "lossless_columns": raw & ~declared, "resolution": dict(zip(keys, steps)), "samples": samples} | more


def record_at(data, at):
    """(kind, content, end) or None; content is None if its CRC does not match."""
    head = data[at:at + 16]
    if len(head) < 16 or head[:4] != b"\xa7NLr" or struct.unpack_from("<I", head, 12)[0] != crc32c(head[:12]):
        return None
    length = struct.unpack_from("<I", head, 8)[0]
    end = at + 16 + length + 4
    if end > len(data):
        return None
    content = data[at + 16:at + 16 + length]
    good = struct.unpack_from("<I", data, end - 4)[0] == crc32c(content)
    return head[4], content if good else None, end


def entry(offset, content):
    chunk = read_chunk(content)
    return {"offset": offset, "bytes": len(content), "count": chunk["count"], "first_tick": chunk["first_tick"],
            "last_tick": chunk["last_tick"], "readable": True}


def read_recording(data):
    assert data[:8] == b"\x89NLREC\r\n" and struct.unpack_from("<H", data, 8)[0] == 1
    assert struct.unpack_from("<I", data, 12)[0] == crc32c(data[:12])
    metadata = json.loads(record_at(data, 16)[1])
    result = {"complete": False, "metadata": metadata, "unusable_tail_bytes": 0, "hash": "00" * 32, "chunks": []}
    footer = data[-24:]
    if footer[16:] == b"\x89NLEND\r\n" and struct.unpack_from("<I", footer, 12)[0] == crc32c(footer[:12]):
        _, index, _ = record_at(data, struct.unpack("<Q", footer[:8])[0])
        count = struct.unpack_from("<Q", index)[0]
        chunks = []
        for i in range(count):
            offset, size, samples, first, last = struct.unpack_from("<QIIQQ", index, 8 + 32 * i)
            content = record_at(data, offset)[1]
            chunks.append(content)
            result["chunks"].append({"offset": offset, "bytes": size, "count": samples, "first_tick": first, "last_tick": last,
                                     "readable": content is not None and read_chunk(content)["count"] == samples})
        result["complete"] = True
        result["hash"] = index[8 + 32 * count:][:32].hex()
        if None not in chunks:
            assert hashlib.blake2b(b"".join(chunks), digest_size=32).hexdigest() == result["hash"]
        return result
    at = 16
    while (record := record_at(data, at)) is not None:
        if record[0] == 2:
            result["chunks"].append(entry(at, record[1]))
        at = record[2]
    result["unusable_tail_bytes"] = len(data) - at
    return result


def main():
    folder = pathlib.Path(__file__).parent
    files = sorted(folder.glob("*.chunk")) + sorted(folder.glob("*.rec"))
    assert files, "no golden files"
    bad = 0
    for file in files:
        seen = (read_chunk if file.suffix == ".chunk" else read_recording)(file.read_bytes())
        same = seen == json.loads(pathlib.Path(str(file) + ".json").read_text())
        bad += not same
        print(f"{file.name}: {'as its twin says' if same else 'DIFFERS from its twin'}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
