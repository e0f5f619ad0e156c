"""A server of a folder of results, in this process, as browsers reach it."""

import http.client
import threading
from dataclasses import dataclass
from pathlib import Path

import pytest

from studies.serving import server


@dataclass(frozen=True)
class Served:
    """A server that runs."""

    root: Path
    port: int

    def ask(self, path, method="GET", **headers):
        """The answer to a request whose path is sent as it is: status, headers, bytes."""
        connection = http.client.HTTPConnection(server.LOCALHOST, self.port, timeout=60)
        try:
            connection.putrequest(method, path, skip_host="Host" in headers)
            for name, value in headers.items():
                connection.putheader(name.replace("_", "-"), value)
            connection.endheaders()
            answer = connection.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def text(self, path):
        """The text of a page, which is there."""
        status, _, content = self.ask(path)
        assert status == 200, (path, status)
        return content.decode()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server of an empty folder, which has a file beside it that must not be read."""
    root = tmp_path_factory.mktemp("beside") / "results"
    root.mkdir()
    (root.parent / "secret.txt").write_text("secret")
    with server.bind(server.LOCALHOST, 0) as listening:
        running = server.server_of(root, local=True)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield Served(root, listening.getsockname()[1])
        finally:
            running.should_exit = True
            thread.join()
