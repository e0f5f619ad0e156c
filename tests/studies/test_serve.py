"""The command that serves results: its arguments, messages and exit codes."""

import http.client
import os
import re
import signal
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest

import studies
from studies import serve
from studies.serving import server

ROOT = Path(studies.__file__).parents[1]


def started(folder, *words):
    """The command, as it runs in a folder, and the address that it prints."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(
        [sys.executable, "-m", "studies.serve", *words, "--port", "0"], cwd=folder, env=environment, **pipes
    )
    return process, re.search(r"http://([\d.]+):(\d+)/", process.stdout.readline())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends Ctrl-C to all programs of a terminal")
def test_ctrl_c_ends_it_with_the_code_of_every_command_while_a_browser_keeps_its_connection(tmp_path):
    (tmp_path / "results").mkdir()
    process, address = started(tmp_path)
    connection = http.client.HTTPConnection(address[1], int(address[2]), timeout=60)
    connection.request("GET", "/")
    assert connection.getresponse().read()
    process.send_signal(signal.SIGINT)
    out, complaint = process.communicate(timeout=60)
    assert (process.returncode, out, complaint) == (130, "", "interrupted\n")


def test_it_listens_on_this_machine_alone(tmp_path, monkeypatch, capsys):
    listening = []
    monkeypatch.setattr(server, "run", lambda root, found, **_: listening.append(found.getsockname()[0]))
    serve.main([str(tmp_path), "--port", "0"])
    assert listening == ["127.0.0.1"]
    assert capsys.readouterr().err == ""


def test_another_interface_is_named_with_a_warning(tmp_path, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(
        server, "run", lambda root, found, local, browser: asked.append((found.getsockname()[0], local))
    )
    serve.main([str(tmp_path), "--port", "0", "--host", "0.0.0.0"])
    assert asked == [("0.0.0.0", False)]
    warning = capsys.readouterr().err
    assert warning.count("\n") == 1
    assert warning.startswith("studies.serve: warning: whoever reaches this machine through 0.0.0.0 can read all of ")


def test_a_port_that_is_taken_is_an_error_of_one_line(tmp_path, capsys):
    with server.bind(server.LOCALHOST, 0) as taken:
        port = taken.getsockname()[1]
        assert serve.main([str(tmp_path), "--port", str(port)]) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert f"port {port} " in complaint
    assert "--port" in complaint


@pytest.mark.parametrize(
    "words", [["--port", "99999"], ["--port", "-1"], ["--host", "192.0.2.1"], ["--host", "no.such.host.invalid"]]
)
def test_an_interface_or_port_that_does_not_exist_is_an_error_of_one_line(tmp_path, capsys, words):
    assert serve.main([str(tmp_path), *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_folder_that_is_not_there_is_an_error_of_one_line(tmp_path, capsys):
    assert serve.main([str(tmp_path / "nowhere")]) == 2
    assert capsys.readouterr().err == f"studies.serve: error: {tmp_path / 'nowhere'} is not a folder\n"


def test_a_browser_is_opened_only_if_it_is_asked_for(tmp_path, monkeypatch):
    opened = []

    class Ended:
        def run(self, sockets):
            raise KeyboardInterrupt

    class AtOnce:
        def __init__(self, target, args, daemon):
            self.start = lambda: target(*args)

    monkeypatch.setattr(server, "server_of", lambda root, local: Ended())
    monkeypatch.setattr(server.threading, "Thread", AtOnce)
    monkeypatch.setattr(webbrowser, "open", opened.append)
    for words in ([], ["--open"]):
        with pytest.raises(KeyboardInterrupt):
            serve.main([str(tmp_path), "--port", "0", *words])
    (address,) = opened
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", address)


@pytest.mark.parametrize(("host", "local"), [("127.0.0.1", True), ("localhost", True), ("::1", True), ("::", False)])
def test_interfaces_of_this_machine_alone_are_told_from_others(host, local):
    assert server.is_local(host) == local


def test_an_address_is_one_that_a_browser_takes():
    class Listening:
        def __init__(self, *name):
            self.getsockname = lambda: name

    assert server.address(Listening("::1", 80, 0, 0)) == "http://[::1]:80/"
    assert server.address(Listening("127.0.0.1", 80)) == "http://127.0.0.1:80/"
