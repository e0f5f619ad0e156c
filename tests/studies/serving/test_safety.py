"""What the server must never do: read files elsewhere, write, or let a page do what it is not for."""

import os
from urllib.parse import quote

import pytest

from studies.serving.site import Site


@pytest.fixture(scope="module")
def outside(served):
    """Links in the folder of results that lead out of it, and one that does not."""
    (served.root / "a").mkdir()
    (served.root / "a" / "inside.txt").write_text("inside")
    (served.root / ".hidden.txt").write_text("hidden")
    (served.root / "file_link.txt").symlink_to(served.root.parent / "secret.txt")
    (served.root / "folder_link").symlink_to(served.root.parent)
    (served.root / "inner_link.txt").symlink_to(served.root / "a" / "inside.txt")
    return served


ATTACKS = (
    "/../secret.txt",
    "/a/../../secret.txt",
    "/%2e%2e/secret.txt",
    "/a/%2e%2e/%2E%2E/secret.txt",
    "/.%2e/secret.txt",
    "/..%2fsecret.txt",
    "/a%2f..%2f..%2fsecret.txt",
    "/%252e%252e/secret.txt",
    "/..\\secret.txt",
    "/..%5csecret.txt",
    "/a/..%5C..%5Csecret.txt",
    "/%c0%ae%c0%ae/secret.txt",
    "/file_link.txt",
    "/folder_link/secret.txt",
    "/a/inside.txt%00.png",
    "/%00",
    "/a/./inside.txt",
    "/a//inside.txt",
    "/.hidden.txt",
    "/-/../secret.txt",
    "/-/..%2f..%2f..%2f..%2f..%2f..%2f..%2f..%2fetc%2fpasswd",
    "/-/pages.py",
    "/-/..%2fpages.py",
    "/-/index.html",
    "/-/live/../secret.txt",
    "/-/live/%2e%2e/",
    "/-/live/folder_link/",
    "//etc/passwd",
    "/%2fetc%2fpasswd",
    "/C:%5Cwindows%5Cwin.ini",
    "/a/" + "x" * 5000,
)


@pytest.mark.parametrize("path", ATTACKS)
@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_nothing_outside_the_results_is_read(outside, path, method):
    status, _, content = outside.ask(path, method)
    assert status == 404
    assert b"secret" not in content


def test_an_absolute_path_is_not_read(outside):
    secret = quote(str(outside.root.parent / "secret.txt"))
    for path in (secret, f"/{secret}", quote(secret, safe=""), f"file://{secret}"):
        assert outside.ask(path)[0] in (400, 404), path


def test_files_inside_are_read_as_they_are_also_through_links_that_stay_inside(outside):
    content = bytes(range(256)) * 500
    (outside.root / "trials.bin").write_bytes(content)
    assert outside.ask("/trials.bin")[2] == content
    assert outside.ask("/a/inside.txt")[2] == outside.ask("/inner_link.txt")[2] == b"inside"
    assert outside.ask("/a/inside.txt?x=/../secret.txt")[2] == b"inside"


def test_a_name_that_is_not_text_is_found_by_its_bytes(tmp_path):
    name = os.fsdecode(b"K\xfcche #1?.txt")
    try:
        (tmp_path / name).write_text("")
    except OSError:
        pytest.skip("this file system has no such names")
    site = Site(tmp_path)
    assert site.href(tmp_path / name) == "/K%FCche%20%231%3F.txt"
    assert site.find(site.href(tmp_path / name).encode()) == tmp_path / name


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "PROPFIND", "TRACE"])
@pytest.mark.parametrize("path", ["/", "/a/inside.txt", "/-/live.js", "/-/live/a/"])
def test_nothing_but_reading_is_answered(outside, method, path):
    status, headers, _ = outside.ask(path, method)
    assert status == 405
    assert set(headers["allow"].split(", ")) == {"GET", "HEAD"}
    assert (outside.root / "a" / "inside.txt").read_text() == "inside"


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:80", "", "localhost.evil.example"])
def test_a_page_from_elsewhere_whose_name_stands_for_this_machine_reads_nothing(outside, host):
    assert outside.ask("/a/inside.txt", Host=host)[0] == 400


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:8765", "[::1]:8765"])
def test_this_machine_is_asked_for_by_its_own_names(outside, host):
    assert outside.ask("/a/inside.txt", Host=host)[0] == 200


def policy(headers):
    """The content security policy as a dict."""
    return dict(each.strip().partition(" ")[::2] for each in headers["content-security-policy"].split(";"))


def test_every_answer_keeps_browsers_from_guessing_framing_and_sharing(outside):
    (outside.root / "report.html").write_text("<script>1</script>")
    (outside.root / "picture.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'><script>1</script></svg>")
    for path in ("/", "/-/live.js", "/report.html", "/picture.svg", "/a/inside.txt", "/nothing", "/%2e%2e/"):
        _, headers, _ = outside.ask(path)
        assert headers["x-content-type-options"] == "nosniff", path
        assert headers["x-frame-options"] == "DENY", path
        assert headers["cross-origin-resource-policy"] == "same-origin", path
        assert policy(headers)["frame-ancestors"] == "'none'", path
        assert policy(headers)["default-src"] == "'none'", path
        assert not any("http" in sources or "*" in sources for sources in policy(headers).values()), path
        assert "server" not in headers
    assert policy(outside.ask("/")[1])["script-src"] == "'self'"
    assert "'unsafe-inline'" in policy(outside.ask("/report.html")[1])["script-src"]
    assert "sandbox" in policy(outside.ask("/picture.svg")[1])


def test_a_file_that_has_not_changed_is_not_sent_again(outside):
    _, headers, content = outside.ask("/a/inside.txt")
    status, again, nothing = outside.ask("/a/inside.txt", If_None_Match=headers["etag"])
    assert (status, again["etag"], nothing) == (304, headers["etag"], b"")
    assert outside.ask("/a/inside.txt", If_None_Match='"other"')[2] == content


def test_what_a_page_may_do_is_the_same_when_it_is_not_sent_again(outside):
    (outside.root / "report.html").write_text("<script>1</script>")
    for path in ("/", "/report.html", "/-/live.js", "/a/inside.txt"):
        _, headers, _ = outside.ask(path)
        status, again, _ = outside.ask(path, If_None_Match=headers["etag"])
        assert status == 304, path
        assert again["content-security-policy"] == headers["content-security-policy"], path
