"""The page in a real browser: it asks for nothing, complains of nothing, and fits a phone and paper."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from browser import Browser, find
from test_report_page import full_comparison, write_full

from hsslam_eval.comparison import Study
from hsslam_eval.report import write_report

OVERFLOW = """
Array.from(document.querySelectorAll('body *'))
  .filter(e => !e.closest('.scroll') && !e.closest('pre'))
  .filter(e => e.getBoundingClientRect().right > window.innerWidth + 1)
  .map(e => e.tagName + '.' + e.className)
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_full(full_comparison(), tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    executable = find()
    if executable is None:
        pytest.skip("PAGE NOT TESTED IN A BROWSER: no Chromium on the path (set HSSLAM_CHROMIUM to one)")
    with Browser(executable) as opened:
        yield opened


def test_the_browser_would_notice(browser: Browser, tmp_path: Path) -> None:
    """A page with every fault that the other tests look for."""
    bad = tmp_path / "bad.html"
    bad.write_text(
        "<body><div style='width:3000px'>wide</div><img src='http://127.0.0.1:9/nothing.png'>"
        "<script>console.error('oh no'); undefinedFunction()</script>"
    )
    before, said = len(browser.heard.requests), len(browser.heard.complaints)
    browser.open(bad, 390, 844)
    assert "http://127.0.0.1:9/nothing.png" in browser.heard.requests[before:]
    complaints = " ".join(browser.heard.complaints[said:])
    assert "oh no" in complaints and "undefinedFunction" in complaints
    assert browser.evaluate(OVERFLOW) == ["DIV."]


@pytest.mark.parametrize(("width", "mobile"), [(1280, False), (390, True), (320, True)])
def test_it_asks_for_nothing_and_fits(browser: Browser, page: Path, width: int, mobile: bool) -> None:
    before, said = len(browser.heard.requests), len(browser.heard.complaints)
    browser.open(page, width, 844, mobile)
    asked = [url for url in browser.heard.requests[before:] if not url.startswith("data:")]
    assert asked == [page.resolve().as_uri()]
    assert browser.heard.complaints[said:] == []
    assert browser.evaluate("document.documentElement.scrollWidth") <= width
    assert browser.evaluate(OVERFLOW) == []
    broken = "Array.from(document.images).filter(i => !i.complete || i.naturalWidth === 0).length"
    assert browser.evaluate(broken) == 0
    assert browser.evaluate("document.images.length") > 5
    sizes = "Array.from(document.querySelectorAll('p, td, th')).map(e => parseFloat(getComputedStyle(e).fontSize))"
    assert min(browser.evaluate(sizes)) >= 11.0


def test_links_lead_to_places_that_are_seen(browser: Browser, page: Path) -> None:
    browser.open(page, 1280, 900)
    heights = browser.evaluate(
        "Array.from(document.querySelectorAll('nav a')).map(a => "
        "document.querySelector(a.getAttribute('href')).getBoundingClientRect().height)"
    )
    assert len(heights) > 3 and min(heights) > 0


def test_it_prints(browser: Browser, page: Path) -> None:
    browser.open(page, 1280, 900)
    browser.do("Emulation.setEmulatedMedia", media="print")
    # The width of A4 within Chromium's margins.
    browser.do(
        "Emulation.setDeviceMetricsOverride", width=718, height=1000, deviceScaleFactor=1, mobile=False
    )
    cut = "Array.from(document.querySelectorAll('table')).filter(t => t.getBoundingClientRect().right > 719).length"
    assert browser.evaluate(cut) == 0
    assert browser.evaluate("getComputedStyle(document.querySelector('nav')).display") == "none"
    printed = browser.pdf()
    browser.do("Emulation.setEmulatedMedia", media="")
    assert printed.startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 20


def test_two_datasets_on_one_page(browser: Browser, tmp_path: Path) -> None:
    gone = [matcher for matcher in full_comparison().matchers if matcher.label == "gone"]
    one = replace(full_comparison(), matchers=gone)
    page = write_report(Study([one, one]), tmp_path)
    browser.open(page, 390, 844, True)
    ids = browser.evaluate("Array.from(document.querySelectorAll('[id]')).map(e => e.id)")
    assert len(ids) == len(set(ids)) and {"office", "office-2"} <= set(ids)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 390
