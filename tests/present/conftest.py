"""A browser for the tests of pages: Debian's Chromium, driven by Playwright."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.waiting import HANGS

CHROMIUM = Path(os.environ.get("PIAZZI_CHROMIUM") or "/usr/bin/chromium")
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip

OpenPage = Callable[..., Any]


def absent(why: str) -> None:
    """Skip, or fail where the browser tests must run (in CI)."""
    if os.environ.get("PIAZZI_BROWSER") == "required":
        pytest.fail(why)
    pytest.skip(why)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A browser without a window."""
    if not CHROMIUM.exists():
        absent(f"no browser at {CHROMIUM}: install Debian's chromium, or name another in PIAZZI_CHROMIUM")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        absent("playwright is not installed: it is in the extra dev")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=str(CHROMIUM), headless=True, args=FLAGS, timeout=1000 * HANGS)
        yield found
        found.close()


@pytest.fixture
def open_page(browser) -> Iterator[OpenPage]:
    """Open a file as a reader does; afterwards nothing may have been asked of a network, nor have gone wrong."""
    contexts, faults, asked = [], [], []

    def open_page(path: Path, width: int = 1280, scheme: str = "light") -> Any:
        context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(1000 * HANGS)
        page.on("console", lambda message: faults.append(message.text))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("dialog", lambda dialog: (faults.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready]")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert faults == []
    assert len(asked) == len(contexts), asked  # the file itself, once for each time it was opened
