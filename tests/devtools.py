"""Chromium, driven through its DevTools protocol, and the live page without a browser: to move, click and listen."""

import asyncio
import base64
import json
import re
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

from tornado import httpclient
from tornado.websocket import websocket_connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
HOW = (
    *(
        "--headless=new",
        "--no-sandbox",
        "--disable-background-networking",
        "--no-first-run",
        "--remote-debugging-port=0",
    ),
    *("--disable-gpu", "--hide-scrollbars", "--disable-extensions"),
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


class Browser:
    """Chromium without a window, its profile in a folder."""

    def __init__(self, folder: Path) -> None:
        self.loop = asyncio.new_event_loop()
        self.process = subprocess.Popen(
            [CHROMIUM, *HOW, f"--user-data-dir={folder}", "about:blank"], stderr=subprocess.DEVNULL
        )
        port_file, end = folder / "DevToolsActivePort", time.monotonic() + 60
        while not (port_file.exists() and port_file.read_text().count("\n")):
            assert self.process.poll() is None, "chromium has ended"
            assert time.monotonic() < end, "chromium does not begin"
            time.sleep(0.05)
        self.address = f"http://127.0.0.1:{port_file.read_text().split()[0]}"

    def open(self, address: str, width: int = 1400, height: int = 1000) -> "Tab":
        """A page in a tab of its own."""
        request = urllib.request.Request(f"{self.address}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request) as answer:
            about = json.load(answer)
        tab = Tab(self, about["webSocketDebuggerUrl"], about["id"])
        tab.resize(width, height)
        tab.ask("Page.navigate", url=address)
        return tab

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self.process.wait()
        self.loop.close()


class Tab:
    """A page: what it was told, what it said and what it asked of the network."""

    def __init__(self, browser: Browser, address: str, name: str) -> None:
        self.browser, self.name, self.number = browser, name, 0
        self.errors: list[str] = []
        self.asked: list[str] = []

        async def connected():
            return await websocket_connect(address, max_message_size=2**28)

        self.line = browser.loop.run_until_complete(connected())
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters):
        """What a command of the protocol answers."""
        self.number += 1
        message = json.dumps({"id": self.number, "method": method, "params": parameters})

        async def answered():
            await self.line.write_message(message)
            while True:
                text = await self.line.read_message()
                assert text is not None, "the tab is gone"
                said = json.loads(text)
                if said.get("id") == self.number:
                    return said
                self._listen(said)

        said = self.browser.loop.run_until_complete(asyncio.wait_for(answered(), 60))
        assert "error" not in said, said
        return said["result"]

    def _listen(self, said):
        method, about = said["method"], said.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(about["exceptionDetails"])[:2000])
        elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "assert"):
            self.errors.append(json.dumps(about["args"])[:2000])
        elif method == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(json.dumps(about["entry"])[:2000])
        elif method == "Network.requestWillBeSent":
            self.asked.append(about["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.asked.append(about["url"])

    def run(self, program: str):
        """The value of an expression of JavaScript, awaited."""
        answer = self.ask("Runtime.evaluate", expression=program, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, program: str, seconds: float = 40.0):
        """The first value of an expression that is true."""
        end = time.monotonic() + seconds
        while not (value := self.run(program)):
            assert time.monotonic() < end, f"never true: {program}; errors: {self.errors}"
            time.sleep(0.05)
        return value

    def resize(self, width: int, height: int) -> None:
        """The window, as on a desk or on a phone."""
        self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def mouse(self, *places: tuple[float, float]) -> None:
        """Press at the first place, go to the others, and let go at the last."""
        for kind, (x, y) in (("mousePressed", places[0]), *(("mouseMoved", p) for p in places[1:])):
            buttons = {"button": "left", "buttons": 1, "clickCount": 1}
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **buttons)
        x, y = places[-1]
        self.ask("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)

    def picture(self, path: Path) -> None:
        """The whole page as a PNG."""
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    def close(self) -> None:
        """Close the page."""
        with urllib.request.urlopen(f"{self.browser.address}/json/close/{self.name}"):
            self.line.close()


class LivePage:
    """A page of `spinlev explore` without a browser: what it shows, by name and property, and what its reader does."""

    def __init__(self, address: str, query: str = "") -> None:
        self.loop = asyncio.new_event_loop()
        self.names: dict[str, str] = {}
        self.shown: dict[str, dict[str, object]] = {}
        self.number, self.whole = 0, False
        parts = urlsplit(address)
        try:
            with urllib.request.urlopen(f"{address}{query and '&' + query}", timeout=60) as answer:
                text = answer.read().decode()
            token = re.search(r'"token":"([^"]*)"', text)[1]
            line = httpclient.HTTPRequest(f"ws://{parts.netloc}/ws?{parts.query}", request_timeout=60)
            self.line = self.loop.run_until_complete(self._joined(line, token))
            self.loop.run_until_complete(asyncio.wait_for(self._hear(), 60))  # that it is ready
            self.say("PULL-DOC-REQ", {})
            self.until(lambda: self.whole)
        except BaseException:
            self.loop.close()
            raise

    async def _joined(self, line, token):
        return await websocket_connect(line, subprotocols=["bokeh", token], max_message_size=2**28)

    def say(self, kind: str, content: object) -> None:
        """Send a message of Bokeh's protocol."""
        self.number += 1
        header = {"msgid": str(self.number), "msgtype": kind}

        async def sent():
            for part in (header, {}, content):
                await self.line.write_message(json.dumps(part))

        self.loop.run_until_complete(sent())

    def set(self, name: str, value: object, attribute: str = "value") -> None:
        """Move a slider, choose, or put a file in."""
        event = {"kind": "ModelChanged", "model": {"id": self.names[name]}, "attr": attribute, "new": value}
        self.say("PATCH-DOC", {"events": [event]})

    def click(self, name: str) -> None:
        """Press a button."""
        values = {"type": "map", "entries": [["model", {"id": self.names[name]}]]}
        event = {"type": "event", "name": "button_click", "values": values}
        self.say("PATCH-DOC", {"events": [{"kind": "MessageSent", "msg_type": "bokeh_event", "msg_data": event}]})

    def get(self, name: str, attribute: str = "text") -> object:
        """A property as it is shown."""
        return self.shown.get(self.names.get(name, ""), {}).get(attribute)

    def until(self, true, seconds: float = 120.0):
        """Hear what the page says until something is true, and what that is."""
        end = time.monotonic() + seconds
        while not (found := true()):
            try:
                self.loop.run_until_complete(asyncio.wait_for(self._hear(), end - time.monotonic()))
            except TimeoutError:
                raise AssertionError(f"never true; message: {self.get('message')}, sign: {self.get('sign')}") from None
        return found

    def answered(self, seconds: float = 120.0) -> str:
        """What is said when an answer or a message is there."""
        return str(self.until(lambda: self.get("message") or self.get("headline"), seconds))

    async def _hear(self) -> None:
        frames = [await self.line.read_message() for _ in range(3)]
        assert None not in frames, f"the line was closed: {self.line.close_code} {self.line.close_reason}"
        header, _, content = (json.loads(frame) for frame in frames)
        for _ in range(2 * header.get("num_buffers", 0)):
            await self.line.read_message()
        self.whole |= header["msgtype"] == "PULL-DOC-REPLY"
        self._note(content.get("doc", content))
        for event in content.get("events", []):
            if event["kind"] == "ModelChanged":
                self.shown.setdefault(event["model"]["id"], {})[event["attr"]] = event["new"]

    def _note(self, value: object) -> None:
        """Names and properties of all models in what was said."""
        if isinstance(value, list):
            for part in value:
                self._note(part)
        elif isinstance(value, dict):
            if value.get("type") == "object" and "id" in value:
                known = value.get("attributes", {})
                self.shown.setdefault(value["id"], {}).update(known)
                if "name" in known:
                    self.names[known["name"]] = value["id"]
            for part in value.values():
                self._note(part)

    def close(self) -> None:
        """Leave."""
        if self.loop.is_closed():
            return

        async def left():
            self.line.close()

        self.loop.run_until_complete(left())
        self.loop.close()
