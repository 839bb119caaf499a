#!/usr/bin/python3
"""fd_groups.py CLASSIC.log FD.log: compares two logs of candump -l of one configuration, staged in classic frames and in CAN FD groups.
The groups are read by docs/protocol.md alone. Each unit must have received the same, in the same order. The frames are counted."""

import re
import sys

BEGIN, SEGMENT, CONFIRM = 5, 6, 7
LENGTHS = {BEGIN: 5, SEGMENT: 8, CONFIRM: 2}
GROUP_ID = 0x1107F800


def fail(text):
    sys.exit(f"fd_groups: {text}")


def entries(data, line):
    """Yields (node, function, detail, data) of each entry of a group."""
    while data and data[0] != 0xFF:
        node, function, detail = data[0], data[2] >> 3, data[2] & 7
        if function not in LENGTHS or len(data) < 3 + LENGTHS[function]:
            fail(f"no group: {line}")
        yield node, function, detail, bytes(data[3:3 + LENGTHS[function]])
        data = data[3 + LENGTHS[function]:]
    if set(data) - {0xFF}:
        fail(f"no fill: {line}")


def read(path):
    received = {}  # (bus, node): staged data, in order, repeats left out
    frames = groups = grouped = 0
    for line in open(path, encoding="ascii"):
        match = re.fullmatch(r"\(.*\) (\S+) ([0-9A-F]{8})#(#[0-9A-F])?([0-9A-F]*)( [RT])?\n", line)
        if not match:
            fail(f"not candump: {line}")
        bus, identifier, fd, data = match[1], int(match[2], 16), match[3], bytes.fromhex(match[4])
        if fd:
            if identifier != GROUP_ID:
                fail(f"a CAN FD frame that is no group: {line}")
            staged = list(entries(data, line))
            if len(staged) < 2:
                fail(f"one frame alone goes classic: {line}")
            groups += 1
            grouped += len(staged)
        else:
            function = identifier >> 20 & 63
            if identifier >> 19 & 1 or function not in LENGTHS:
                continue
            staged = [(identifier >> 11 & 255, function, identifier & 7, data)]
        frames += 1
        for node, *what in staged:
            unit = received.setdefault((bus, node), [])
            if what not in unit:
                unit.append(what)
    return received, frames, groups, grouped


classic, classic_frames, none, _ = read(sys.argv[1])
groups_received, fd_frames, groups, grouped = read(sys.argv[2])
if none or not classic:
    fail("the first log is not of classic staging")
if classic.keys() != groups_received.keys():
    fail(f"other units: {classic.keys() ^ groups_received.keys()}")
for unit, received in classic.items():
    if received != groups_received[unit]:
        fail(f"unit {unit} received {groups_received[unit]}, not {received}")
if grouped < 2 * groups or fd_frames * 2 > classic_frames:
    fail(f"{fd_frames} frames stage what {classic_frames} did: hardly any are saved")
print(f"fd_groups: {len(classic)} units were staged the same by {classic_frames} classic frames and by {groups} groups "
      f"({grouped} entries) with {fd_frames - groups} classic frames: {classic_frames - fd_frames} frames saved")
