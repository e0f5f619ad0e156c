"""The server itself: where it listens, and how it ends."""

from __future__ import annotations

import ipaddress
import socket
import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    import uvicorn

LOCALHOST = "127.0.0.1"
DEFAULT_PORT = 8765

_NAMES_OF_THIS_MACHINE = ("127.0.0.1", "localhost", "[::1]")
_END_SECONDS = 2  # that a download has left when the server ends


def bind(host: str, port: int) -> socket.socket:
    """A socket that listens.

    Parameters
    ----------
    host : str
        name or number of the interface
    port : int
        0 for any that is free

    Raises
    ------
    OSError
        If it is taken, or not one of this machine.
    """
    family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
    return socket.create_server((host, port), family=family)


def is_local(host: str) -> bool:
    """Whether only programs on this machine reach an interface.

    Examples
    --------
    >>> is_local("127.0.0.1"), is_local("localhost"), is_local("0.0.0.0")
    (True, True, False)
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def address(listening: socket.socket) -> str:
    """The address of a server, as a browser takes it."""
    host, port = listening.getsockname()[:2]
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/"


def server_of(root: Path, *, local: bool) -> uvicorn.Server:
    """The server of a folder of results.

    Parameters
    ----------
    root : Path
    local : bool
        whether it is to be asked for by the names of this machine alone
    """
    import uvicorn

    from studies.serving.application import application

    config = uvicorn.Config(
        application(root, _NAMES_OF_THIS_MACHINE if local else ("*",)),
        log_level="error",
        access_log=False,
        lifespan="off",
        ws="none",
        loop="asyncio",
        http="h11",
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=_END_SECONDS,
    )
    return uvicorn.Server(config)


def run(root: Path, listening: socket.socket, *, local: bool, browser: bool = False) -> NoReturn:
    """Serve a folder of results until Ctrl-C, which raises KeyboardInterrupt.

    Parameters
    ----------
    root : Path
    listening : socket
        as `bind` returns it
    local : bool
        whether it is to be asked for by the names of this machine alone
    browser : bool
        open its first page in a browser
    """
    server = server_of(root, local=local)
    if browser:
        # It listens already, and answers as soon as it runs; some browsers return only when they are closed.
        threading.Thread(target=webbrowser.open, args=(address(listening),), daemon=True).start()
    server.run(sockets=[listening])
    raise KeyboardInterrupt  # nothing else ends it; a shell that starts it in the background has it ignore Ctrl-C
