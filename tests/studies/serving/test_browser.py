"""The server's pages in a real browser, under the server's own rules about what a page may do."""

import pytest

from studies.storage import RowStore
from tests.helpers.browser import browser, open_page
from tests.studies.storage.example_rows import row


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


def test_new_rows_new_studies_and_the_report_appear_without_a_reload(served, chromium):
    page, complaints = open_page(chromium, f"http://127.0.0.1:{served.port}/")
    page.evaluate("window.mark = 1")
    folder = served.root / "holes" / "ant"
    with RowStore(folder) as store:
        store.write_plan(["a", "b", "c"])
        store.add(row("a", model="<b>first</b>"))
        page.get_by_text("1 of 3").wait_for()  # of a study that was not there
        store.add(row("b", model="second", status="failed", error="no mesh"))
        page.get_by_text("1 failed").wait_for()
        assert page.evaluate("window.mark") == 1
        page.locator(".studies a", has_text="holes/ant").click()
        page.evaluate("window.mark = 1")
        assert page.locator(".failures td").last.text_content() == "no mesh"
        store.add(row("c", model="third"))
        page.get_by_text("3 of 3").wait_for()
        page.locator(".latest td", has_text="third").wait_for()
        assert page.locator(".latest td", has_text="<b>first</b>").count() == 1
        assert page.evaluate("window.mark") == 1
    script = "<script>document.getElementById('made').textContent = 'the report'</script>"
    report = f"<link rel='icon' href='data:,'><p id='made'></p>{script}"
    page.goto(f"http://127.0.0.1:{served.port}/holes/ant/")
    (folder / "report.html").write_text(report)
    page.get_by_text("the report").wait_for()  # whose script has run
    assert complaints == []


def test_a_page_can_neither_load_from_elsewhere_nor_run_what_a_name_brings(served, chromium):
    (served.root / "evil.html").write_text(
        "<img src='http://192.0.2.1/x.png'><script>fetch('/').catch(() => document.title = 'refused')</script>"
    )
    page, complaints = open_page(chromium, f"http://127.0.0.1:{served.port}/evil.html")
    page.wait_for_function("document.title === 'refused'")
    assert sum("Content Security Policy" in complaint for complaint in complaints) >= 2


def test_a_page_says_so_when_the_server_has_ended(served, chromium):
    page, _ = open_page(chromium, f"http://127.0.0.1:{served.port}/")
    page.route("**/*", lambda route: route.abort())
    page.get_by_text("The server has ended").wait_for()
