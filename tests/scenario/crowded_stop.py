#!/usr/bin/python3
"""crowded_stop.py BIN [--units N] [--stops K]: measures how long `stop` takes on the control socket of a daemon that many clients
ask. The daemon is a real focalfleetd with a simulated fleet in it. The clients are a process of their own and ask again as soon as they
are answered. The program prints the times of K stops on a connection of their own beside each group of clients, and beside nobody before
and after them. The exit code is 1 where a stop was not answered, or where the slowest hundredth beside a group took more than RATIO_MAX
times that beside nobody, twice in a row. Times themselves depend on the machine and decide nothing."""

import argparse
import select
import signal
import subprocess
import sys
import tempfile
import time

from simulated_daemon import Refused, ask, connect, make_folder, send, wait_until_ready

# A stop waits for one line of others at most. With 1000 units, 100 stops and a machine that is busy with builds the ratio was at most 4.
# Where stops wait in their turn behind the lines of 40 clients, it was 28 to 59 there.
RATIO_MAX = 12
GROUPS = (("nobody", 0, ""), ("10 ask status", 10, "status"), ("10 ask state", 10, "state"), ("40 ask state", 40, "state"),
          ("64 idle", 64, ""))


def be_clients(path, count, verb):
    """Does not return."""
    ends = {}
    ready = select.epoll()
    for _ in range(count):
        end = connect(path)
        ends[end.fileno()] = end
        ready.register(end.fileno(), select.EPOLLIN)
        if verb:
            send(end, verb)
    print("here", flush=True)
    while True:
        for number, _ in ready.poll():
            said = ends[number].recv(1 << 20)
            if not said:
                ready.unregister(number)  # the daemon dropped it to make room
            elif verb and said.endswith(b"\n"):
                send(ends[number], verb)


def time_stops(path, count):
    times_ms = []
    with connect(path) as end:
        for _ in range(count):
            begin = time.perf_counter()
            ask(end, "stop")
            times_ms.append(1e3 * (time.perf_counter() - begin))
            time.sleep(0.02)
    return sorted(times_ms)


def try_clients(path, name, count, verb, stops):
    """The time within which 99 of 100 stops were answered, in ms; None: one was not."""
    clients = None
    if count:
        clients = subprocess.Popen([sys.executable, __file__, "--clients", path, str(count), verb], stdout=subprocess.PIPE)
        clients.stdout.readline()
    try:
        ms = time_stops(path, stops)
        p99 = ms[(len(ms) - 1) * 99 // 100]
        print(f"{name:16} {ms[len(ms) // 2]:8.2f} {p99:8.2f} {ms[-1]:8.2f}", flush=True)
        return p99
    except (Refused, RuntimeError, OSError) as error:
        print(f"{name:16} NOT ANSWERED: {error}", flush=True)
        return None
    finally:
        if clients:
            clients.kill()
            clients.wait()


def try_all(path, stops):
    """Whether every stop was answered, and none beside clients waited for many of their lines."""
    nobody = GROUPS[0]
    beside = {group: try_clients(path, *group, stops) for group in GROUPS}
    idle = [beside.pop(nobody), try_clients(path, *nobody, stops)]
    if None in idle or None in beside.values():
        return False
    most = RATIO_MAX * max(idle)
    well = True
    for group, p99 in beside.items():
        if p99 > most:
            p99 = try_clients(path, *group, stops)  # the machine may have been busy with something else
        if p99 is None or p99 > most:
            print(f"{group[0]}: more than {RATIO_MAX} times the {max(idle):.2f} ms beside nobody")
            well = False
    return well


def main():
    if sys.argv[1:2] == ["--clients"]:
        be_clients(sys.argv[2], int(sys.argv[3]), sys.argv[4])
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin")
    parser.add_argument("--units", type=int, default=5000)
    parser.add_argument("--stops", type=int, default=200)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        command, path = make_folder(options.bin, folder, options.units, "error")
        daemon = subprocess.Popen(command)
        try:
            wait_until_ready(path, daemon)
            print(f"{'beside':16} {'p50_ms':>8} {'p99_ms':>8} {'most_ms':>8}")
            well = try_all(path, options.stops)
        finally:
            daemon.send_signal(signal.SIGTERM)
            daemon.wait()
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
