"""FakeDaemon listens on a UNIX socket and answers each request as a test says."""

import contextlib
import json
import os
import socket
import tempfile
import threading


class FakeDaemon:
    """`answers` maps a verb to what follows: bytes are sent as they are, a callable gets the request
    and its result is the answer's, None closes the connection, HANG answers nothing."""

    HANG = object()

    def __init__(self, answers):
        self.answers = answers
        self.requests = []
        self._folder = tempfile.TemporaryDirectory(prefix="focalfleet-fake")
        self.path = os.path.join(self._folder.name, "control.sock")
        self._server = socket.socket(socket.AF_UNIX)
        self._server.bind(self.path)
        self._server.listen()
        self._over = threading.Event()
        self._clients = []
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.kill()
        self._folder.cleanup()

    def kill(self):
        """Ends the daemon as a kill would: every connection closes, nobody listens."""
        self._over.set()
        for connection in [self._server, *self._clients]:
            # shutdown wakes the thread that waits on the socket; close alone would not.
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()

    def _accept(self):
        while not self._over.is_set():
            try:
                client, _ = self._server.accept()
            except OSError:
                return
            self._clients.append(client)
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client):
        with contextlib.suppress(OSError, ValueError), client.makefile("rb") as lines:
            for line in lines:
                request = json.loads(line)
                self.requests.append(request)
                answer = self.answers[request["verb"]]
                if callable(answer):
                    answer = answer(request)
                if answer is None:
                    client.shutdown(socket.SHUT_RDWR)
                    return
                if answer is self.HANG:
                    self._over.wait()
                    return
                if not isinstance(answer, bytes):
                    full = {"id": request["id"], "ok": True, "result": answer}
                    answer = json.dumps(full).encode() + b"\n"
                client.sendall(answer)


def failure(code, text):
    """An answer that refuses."""

    def answer(request):
        error = {"code": code, "text": text}
        return json.dumps({"id": request["id"], "ok": False, "error": error}).encode() + b"\n"

    return answer
