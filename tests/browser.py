"""A page in a headless Chromium, spoken to in the words of its DevTools."""

import asyncio
import json
import re
import shutil
import subprocess
import urllib.request
from contextlib import asynccontextmanager

import pytest
from tornado.websocket import websocket_connect

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


class Page:
    """An open page. Values of JavaScript come back as JSON says them."""

    def __init__(self, socket):
        self.socket, self.calls = socket, 0

    async def call(self, method, **params):
        """What DevTools answer to a call."""
        self.calls += 1
        await self.socket.write_message(
            json.dumps({"id": self.calls, "method": method, "params": params})
        )
        while (answer := json.loads(await self.socket.read_message())).get("id") != self.calls:
            pass
        return answer["result"]

    async def js(self, code):
        """The value of an expression, awaited if it is a promise."""
        answer = await self.call(
            "Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    async def until(self, code, value, seconds=60):
        """Wait until an expression has a value."""
        for _ in range(10 * seconds):
            if (now := await self.js(code)) == value:
                return
            await asyncio.sleep(0.1)
        raise AssertionError(f"{code} is {now!r}, not {value!r}")


@asynccontextmanager
async def opened(path, profile, *options):
    """The page of a file in a Chromium with more options, whose own files are in `profile`."""
    line = [CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1000,1100",
            "--remote-debugging-port=0", f"--user-data-dir={profile}", *options]  # fmt: skip
    process = subprocess.Popen([*line, path.as_uri()], stderr=subprocess.PIPE, text=True)
    try:
        found = (re.search(r"ws://127.0.0.1:(\d+)/", line) for line in process.stderr)
        port = next(filter(None, found))[1]
        for _ in range(100):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                pages = [p for p in json.load(answer) if p["url"].endswith(path.name)]
            if pages:
                break
            await asyncio.sleep(0.1)
        socket = await websocket_connect(pages[0]["webSocketDebuggerUrl"], max_message_size=2**28)
        page = Page(socket)
        # A new browser shows an empty page, complete, until the file's takes its place.
        there = f"location.pathname.endsWith('/{path.name}') && document.readyState"
        await page.until(there, "complete")
        yield page
    finally:
        process.kill()
        process.wait()


def seen(tmp_path_factory, write, look):
    """What look(folder) finds in pages that write(folder) has written, all in one browser, whose
    start takes longest. Skips the test where there is none."""
    if not CHROMIUM:
        pytest.skip("needs Chromium")
    folder = tmp_path_factory.mktemp("pages")
    write(folder)
    return asyncio.run(look(folder))
